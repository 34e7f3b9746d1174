"""One contestant on one plant in one scenario: with what value of its knob it is best, and how good it is then.

The score of a run is the error relative to the plant's own swing, over all states and the whole run,

    score = sqrt(mean_i (rmse_i / s_i)^2),    s_i the standard deviation of x_i along the run,

so that speed and noise both count: a low gain forgets its first error late, a high one passes the noise on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.benchmark.contestants import with_knob
from hgorun.benchmark.parabolas import Floats
from hgorun.benchmark.scan import Scan, Search
from hgorun.config.benchmark import Contestant, Seeds, Tries
from hgorun.ensemble.blocks.block import Block, compute
from hgorun.ensemble.members.members import Members
from hgorun.errors import HgorunError
from hgorun.simulation.error_control.control import controlled
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.passes.passes import as_given, integrate
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.simulate import simulate

TRANSIENT = 3  # one part in so many of a run; the rest is steady
_FEW, _LEAST = 4, 3  # one seed in so many, or so many, are enough to try values all over a range
_STEADY = 20  # seeds whose steady error is looked at
_FOLLOWED = 5  # seeds whose trajectories are looked at
_TIMED = 7  # runs whose time is taken
_LEVEL = 2.0  # times its steady size an error is, when it has converged


@dataclass(frozen=True, kw_only=True)
class Score:
    """What a contestant reaches with its best value, on seeds that were not used for finding it.

    Attributes
    ----------
    value : float
        Of the knob.
    at_end : bool
        Whether it is at an end of its range, beyond which better values may lie.
    total, steady : tuple of float
        For each seed the error relative to the swing: over the whole run; and, for the first of them, without its
        first third. Infinite where the estimate was lost.
    peak : float
        The largest error of any state relative to its swing; median over the seeds.
    converged : float
        How long it takes until the error, over some of the seeds and all states, is at most twice its steady size, and
        half of what it was.
    operations, at_samples : int
        Of the observer's equations: of its right-hand side, and of what it does at a sample.
    nanoseconds : float
        Processor time of plant and observer per step of the plant's file; the least of some runs, since a machine that
        does something else besides only ever makes one longer. It is not compared: no two are the same.
    tried : tuple of (float, tuple of float)
        Values of the knob around the best, and the error of each with every seed of tuning.
    """

    value: float
    at_end: bool
    total: tuple[float, ...]
    steady: tuple[float, ...]
    peak: float
    converged: float
    operations: int
    at_samples: int
    nanoseconds: float = field(compare=False)
    tried: tuple[tuple[float, tuple[float, ...]], ...]

    @property
    def lost(self) -> int:
        """With how many seeds the estimate was lost."""
        return int(np.sum(~np.isfinite(self.total)))


@dataclass(frozen=True, eq=False)
class Trial:
    """A contestant on a plant in a scenario.

    Attributes
    ----------
    experiment : Experiment
        With that observer alone.
    label : str
    contestant : Contestant
    scale : ndarray, shape (n,)
        The swing of each state.
    rate : float
        Of the plant, 1/time.
    steps : float
        In how many steps of the plant's file a run is.
    """

    experiment: Experiment
    label: str
    contestant: Contestant
    scale: Floats
    rate: float
    steps: float

    def score(self, seeds: Seeds, tries: Tries, threads: int = 1) -> Score:
        """Tune and score, with some threads side by side.

        Raises
        ------
        HgorunError
            When no value of the knob keeps the estimate.
        """
        tuning, scoring = np.split(seeds.first + np.arange(seeds.tuning + seeds.scoring), [seeds.tuning])
        start, end = self.experiment.blocks.time.start, self.experiment.blocks.time.end
        whole = self.experiment.varied({"metrics.window": [start, end], "metrics.transient": [start, end]})
        steady = self.experiment.varied({"metrics.window": [start + (end - start) / TRANSIENT, end]})

        scan = Scan(self.contestant.knob, self.rate)
        few = tuning[: max(len(tuning) // _FEW, _LEAST)]
        places = scan.coarse(tries.coarse)
        rough = self._errors(whole, scan.at(places), few, threads).mean(axis=1)
        if not np.isfinite(rough).any():
            low, high = scan.ends
            where = f"of {self.contestant.knob.key} between {low:.3g} and {high:.3g}"
            raise HgorunError(f"diverges with each of {rough.size} values {where}")
        search = Search(scan, lambda values: self._errors(whole, values, tuning, threads))
        value = search.around(float(places[np.argmin(rough)]), 1 / (tries.coarse - 1), tries.fine)
        best = np.array([value])
        found = self._runs(whole, best, scoring, threads, ("rmse", "peak")).metrics
        return Score(
            value=value,
            at_end=scan.is_end(value),
            total=_listed(self._size(found["rmse"][:, 0])),
            steady=_listed(self._errors(steady, best, scoring[:_STEADY], threads)[0]),
            peak=float(np.median(np.max(found["peak"][:, 0] / self.scale, axis=-1))),
            converged=self._converged(value, scoring[:_FOLLOWED].tolist()),
            **_cost(self.experiment, self.label),
            nanoseconds=1e9 * seconds_of(self._tuned(value)) / self.steps,
            tried=tuple((tried, _listed(errors)) for tried, errors in search.tried.items()),
        )

    def _errors(self, base: Experiment, values: Floats, seeds: NDArray[np.int64], threads: int) -> Floats:
        """The error relative to the swing, shape (values, seeds)."""
        found = self._runs(base, values, seeds, threads, ("rmse",))
        return self._size(found.metrics["rmse"][:, 0]).reshape(values.size, seeds.size)

    def _runs(
        self, base: Experiment, values: Floats, seeds: NDArray[np.int64], threads: int, metrics: Sequence[str]
    ) -> Block:
        """Runs with each value and each seed; what cannot be carried out is no more than a lost estimate."""
        columns: dict[str, Any] = {
            f"observers.{self.label}.{key}": np.repeat(given, seeds.size)
            for key, given in with_knob(self.contestant.knob, values).items()
        }
        columns["seed"] = np.tile(seeds, values.size)
        return compute(base, Members.of(columns), metrics=metrics, threads=threads)

    def _size(self, rmse: Floats) -> Floats:
        """Errors of all states together, relative to their swings."""
        return np.asarray(np.sqrt(np.mean((rmse / self.scale) ** 2, axis=-1)))

    def _tuned(self, value: float) -> Experiment:
        given = with_knob(self.contestant.knob, np.array([value]))
        return self.experiment.varied({f"observers.{self.label}.{key}": one[0].item() for key, one in given.items()})

    def _converged(self, value: float, seeds: Sequence[int]) -> float:
        tuned, squares = self._tuned(value), []
        for seed in seeds:
            run = simulate(tuned.varied({}, seed=seed))
            squares.append(np.mean(((run.observers[self.label].xhat - run.x) / self.scale) ** 2, axis=1))
        size, time = np.sqrt(np.mean(squares, axis=0)), run.time - run.time[0]
        steady = float(np.sqrt(np.mean(size[time >= time[-1] / TRANSIENT] ** 2)))
        return first_below(time, size, min(_LEVEL * steady, 0.5 * float(size[0])))


def _cost(experiment: Experiment, label: str) -> dict[str, int]:
    """How many operations the equations of an observer have beside those of its plant."""
    system = prepare(experiment).structure.system
    alone = prepare(experiment.varied({f"observers.{label}": None})).structure.system
    flow, plant = (max(regime.flow.n_instructions() for regime in one.regimes) for one in (system, alone))
    return {
        "operations": flow - plant,
        "at_samples": sum(function.n_instructions() for *_, function in system.jumps),
    }


def seconds_of(experiment: Experiment) -> float:
    """Processor time of integrating it, without what is computed from the trajectories: the least of some runs."""
    run = prepare(experiment)
    times = []
    for _ in range(_TIMED):
        began = thread_time()
        if run.solver.controlled:
            controlled(run, None)
        else:
            integrate(run, as_given(run), None)
        times.append(thread_time() - began)
    return min(times)


def first_below(time: Floats, size: Floats, level: float) -> float:
    """The first time, but that of the start, at which a size is at most a level; the last one where it never is."""
    below = np.flatnonzero(size[1:] <= level)
    return float(time[1 + below[0]] if below.size else time[-1])


def swing(base: Experiment) -> Floats:
    """The standard deviation of each state along the run; of a state that rests, its size."""
    x = simulate(base).x
    size = np.maximum(np.abs(x).max(axis=0), np.finfo(float).tiny)
    spread: Floats = x.std(axis=0)
    return np.where(spread > 1e-6 * size, spread, size)


def _listed(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
