"""Members that can be carried out side by side: one plan, and the numbers of each."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import compress

import numpy as np

from hgorun.engine.member_numbers import MemberNumbers
from hgorun.engine.plan import Plan
from hgorun.ensemble.found import Floats, Integers
from hgorun.measurement.channels import Channel, joined
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import evaluate


@dataclass(frozen=True, eq=False)
class Numbers:
    """The numbers of N members.

    Attributes
    ----------
    z0, p : ndarray, shapes (states, N) and (parameters, N)
    gain, bias : ndarray, shape (N, slots), or (slots,) where all have the same
        How every sample is measured.
    held : ndarray, shape (N, changes) or (changes,)
        The values of held noise.
    """

    z0: Floats
    p: Floats
    gain: Floats
    bias: Floats
    held: Floats

    @classmethod
    def with_noise(cls, z0: Floats, p: Floats, channels: Sequence[Channel]) -> Numbers:
        """With the noise of some channels: of all members alike, or of each its own."""
        measured = [channel.gain_and_bias for channel in channels]
        gain, bias = (joined([both[i] for both in measured]) for i in (0, 1))
        held = joined([channel.held_changes[1] for channel in channels])
        return cls(z0, p, gain, bias, held)

    @classmethod
    def of(cls, runs: Sequence[PreparedRun]) -> Numbers:
        """Those of runs that are prepared."""
        each = [cls.with_noise(run.numbers.z0, run.numbers.p, run.heard) for run in runs]
        rows = {name: np.stack([getattr(one, name) for one in each]) for name in ("gain", "bias", "held")}
        return cls(np.stack([one.z0 for one in each], axis=1), np.stack([one.p for one in each], axis=1), **rows)

    def at(self, i: int) -> tuple[Floats, ...]:
        """All numbers of one member."""
        noise = (part if part.ndim == 1 else part[i] for part in (self.gain, self.bias, self.held))
        return self.z0[:, i], self.p[:, i], *noise

    def some(self, which: np.ndarray) -> Numbers:
        """Those of some members."""
        noise = (part if part.ndim == 1 else part[which] for part in (self.gain, self.bias, self.held))
        return Numbers(self.z0[:, which], self.p[:, which], *noise)

    def beside(self, plan: Plan, bound: tuple[float, float]) -> MemberNumbers:
        """As the engine takes them; what is held besides noise is the plan's."""
        holds = plan.holds
        if self.held.ndim == 2:
            rest = plan.holds[self.held.shape[-1] :]
            holds = joined([self.held, np.broadcast_to(rest, (len(self.held), rest.size))]).T
        gain, bias = (part if part.ndim == 1 else part.T for part in (self.gain, self.bias))
        return MemberNumbers(z0=self.z0, p=self.p, gain=gain, bias=bias, holds=holds, bound=bound)


@dataclass(frozen=True, eq=False)
class Lot:
    """Members that are carried out side by side.

    Attributes
    ----------
    run : PreparedRun
        Whose equations, grid and settings all of them have.
    which : ndarray of int64, shape (N,)
        Which members they are.
    numbers : Numbers
    own : tuple of PreparedRun, optional
        Their runs, where events are at other times in each; else they are those of ``run``.
    plans : tuple of Plan, optional
        Their plans instead, for steps as they are given.
    """

    run: PreparedRun
    which: Integers
    numbers: Numbers
    own: tuple[PreparedRun, ...] | None = None
    plans: tuple[Plan, ...] | None = None

    @classmethod
    def of(cls, which: Sequence[int], runs: Sequence[PreparedRun]) -> Lot:
        """Of runs that are prepared, with events at times of their own."""
        start = np.stack([run.numbers.z0 for run in runs], axis=1), np.stack([run.numbers.p for run in runs], axis=1)
        nothing = np.zeros(0)  # the plans have it
        return cls(runs[0], np.array(which), Numbers(*start, nothing, nothing, nothing), tuple(runs))

    @classmethod
    def with_plans(cls, run: PreparedRun, plans: Mapping[int, Plan]) -> Lot:
        """Of members that have the start and the parameters of a run, and plans of their own."""
        z0, p = (np.repeat(of[:, None], len(plans), axis=1) for of in (run.numbers.z0, run.numbers.p))
        nothing = np.zeros(0)  # the plans have it
        numbers = Numbers(z0, p, nothing, nothing, nothing)
        return cls(run, np.array(list(plans), dtype=np.int64), numbers, plans=tuple(plans.values()))

    def some(self, among: np.ndarray) -> Lot:
        """Some of them."""
        own = None if self.own is None else tuple(compress(self.own, among))
        plans = None if self.plans is None else tuple(compress(self.plans, among))
        return Lot(self.run, self.which[among], self.numbers.some(among), own, plans)

    def starts(self) -> np.ndarray:
        """Which of them have right-hand sides that are numbers at the start, shape (N,)."""
        system, t = self.run.structure.system, np.array([self.run.time.start])
        held, layout, numbers = np.zeros((self.which.size, system.held.size)), system.held, self.numbers
        z0, p = numbers.z0.T, numbers.p.T
        (channels,) = evaluate(system.channels, t, p, z0, held)
        for i in range(system.outputs):
            output = channels[:, i * system.width : (i + 1) * system.width]
            held[:, layout.previous(i)] = output[:, 0]
            held[:, layout.output(i) : layout.output(i) + system.width] = output
        held[:, layout.interval] = 1.0
        (rates,) = evaluate(system.regimes[0].flow, t, p, z0, held)
        return np.asarray(np.all(np.isfinite(rates), axis=1))


def times_of(run: PreparedRun) -> Hashable:
    """All that decides when something happens in a run; equal for runs that can have one plan."""
    schedule, digest = run.schedule, blake2b(digest_size=16)
    acting = np.zeros(0) if schedule.acting is None else schedule.acting
    for array in (schedule.events, schedule.inward, schedule.variant, acting):
        digest.update(array.tobytes())
    timings = tuple(channel.timing for channel in run.channels)
    return run.step, run.smallest_delay, run.reach, schedule.variants, digest.digest(), timings


def settings_of(run: PreparedRun) -> Hashable:
    """What else runs side by side have in common: equations, grid, solver, metrics."""
    blocks = run.experiment.blocks
    return id(run.structure), blocks.time, blocks.solver, blocks.metrics
