"""Observers that follow samples as they come."""

from __future__ import annotations

import hashlib
import io
import json
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, TAKE
from hgorun.engine.live import Live
from hgorun.engine.memory import Start
from hgorun.engine.plan import Floats, Integers
from hgorun.errors import ConfigError, HgorunError, Problem
from hgorun.estimate.carrying import Gate, leave_out
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.given import as_number, numbers_by_name
from hgorun.estimate.together import Kinds
from hgorun.measurement.variants import HELD, SILENT
from hgorun.observers.base import SampledObserver, treatment_of
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.first_step import nominal_step
from hgorun.simulation.preparation import check_limit, numbers_of
from hgorun.simulation.structure import structure_of
from hgorun.simulation.truth import Recording
from hgorun.symbolic.evaluate import evaluate

_MAGIC = b"hgorun-estimator-1\n"
_MOST_OUTPUTS = 6  # whose every combination of heard and not heard is compiled
_LARGEST = 1e300
_TOGETHER = 4096  # samples in one native call
_LATE = 8  # samples of one output that may be on their way at once
_FARTHEST = 1e8  # steps to the next event, a minute or so: what is further off is on another clock, as that of Unix


@dataclass(frozen=True, eq=False, repr=False)
class _Event:
    """What happens at a time.

    Attributes
    ----------
    t : float
    take : tuple of (output, slot)
        What of the estimates is kept for samples that come later.
    samples : tuple of (output, slot, value, used)
        What arrives.
    taken : float
        When these were measured.
    inputs : tuple of (input, value)
        What changes.
    """

    t: float
    take: tuple[tuple[int, int], ...] = ()
    samples: tuple[tuple[int, int, float, bool], ...] = ()
    inputs: tuple[tuple[int, float], ...] = ()
    taken: float = np.nan

    def joined(self, other: _Event) -> _Event:
        """With the samples of another event at the same time."""
        take, samples = sorted(self.take + other.take), sorted(self.samples + other.samples)
        return _Event(self.t, tuple(take), tuple(samples), self.inputs, self.taken)


class Estimator:
    """The observers of an experiment on samples that come one after the other.

    At the times of samples the estimates have the bits of ``hgorun estimate`` with the same steps. Memory is constant.

    Parameters
    ----------
    experiment : Experiment
        Its plant is what the observers copy. Estimates begin at ``time.start`` with the observers' ``initial``.
    gates : mapping of str to float, optional
        By output, standard deviations of the innovation beyond which a sample is not used.
    inputs : sequence of str
        Inputs that are given with the samples, and held; the others are expressions of the time.
    remembered : int
        So many events are remembered for samples that come late; what was taken before them is refused.

    Raises
    ------
    ConfigError

    Examples
    --------
    >>> estimator = Estimator(hgorun.load("config.yaml"))
    >>> estimator.update(0.1, {"y": 0.52})
    >>> estimator.predict(0.15)["SHGO"]
    """

    def __init__(
        self,
        experiment: Experiment,
        *,
        gates: Mapping[str, float] | None = None,
        inputs: tuple[str, ...] = (),
        remembered: int = 1000,
    ) -> None:
        self._experiment = experiment
        with experiment.located():
            self._prepare(experiment, tuple(inputs))
        model, gates = experiment.plant.model, gates or {}
        self._outputs = {name: i for i, name in enumerate(model.outputs)}
        for name in gates:
            self._output(name)
        limits = [gates.get(name) for name in model.outputs]
        self._gate = Gate(experiment, limits, self._covariances) if gates else None
        self._gated = [limit is not None for limit in limits]
        self._heard = [False] * len(model.outputs)
        self._newest = [-np.inf] * len(model.outputs)
        self._pending = [0] * len(model.outputs)
        self._last_sample = np.nan
        self._events: deque[_Event] = deque(maxlen=remembered)
        self._before: deque[tuple[dict[str, Floats], bytes]] = deque(maxlen=remembered)
        self._remembers = remembered > 0
        known = all(one.places is not None or not one.function.size1_in(3) for one in self._structure.estimates)
        self._simple = known and not (self._gate or self._steps or self._remembers)

    def _prepare(self, experiment: Experiment, inputs: tuple[str, ...]) -> None:
        plant = experiment.plant
        model = plant.model
        experiment.require_open("a stream is told its inputs, which no observer here decides")
        for label, observer in experiment.observers.items():
            check_limit(experiment, label, observer)
        if experiment.adaptive:
            raise Problem(("solver", "rtol"), "a stream is followed with steps that are fixed: give step")
        if len(model.outputs) > _MOST_OUTPUTS:
            raise Problem(("plant",), f"a stream has at most {_MOST_OUTPUTS} outputs")
        unknown = [name for name in inputs if name not in model.inputs]
        if unknown:
            raise Problem(("plant", "inputs"), f"unknown input {unknown[0]!r}")
        self._inputs = {name: i for i, name in enumerate(name for name in model.inputs if name in inputs)}
        variants = [tuple((what, 0) for what in row) for row in product((SILENT, HELD), repeat=len(model.outputs))]
        self._regime = {row: number for number, row in enumerate(product((False, True), repeat=len(model.outputs)))}
        designs = list(experiment.designs.values())
        truth = Recording(plant.symbolic, tuple(i for i, name in enumerate(model.inputs) if name in inputs))
        stretches = experiment.stretches
        structure = structure_of([truth], [designs], stretches, variants, plant.everything, innovations=True)
        numbers = numbers_of(structure, plant, experiment, designs)
        self._structure, self._p = structure, numbers.p
        self._covariances = [Covariance.of(experiment, structure, numbers.p, b) for b in numbers.observers]
        self._labels = [b.label for b in numbers.observers]
        corrections = structure.system.corrections
        self._corrections = [number for number, _, _ in corrections]
        self._steps = [number for number in range(len(structure.system.jumps)) if number not in self._corrections]
        self._treatments = {label: treatment_of(observer) for label, observer in experiment.observers.items()}
        jumping = [b for b in numbers.observers if isinstance(b.observer, SampledObserver)]
        if jumping and len(model.outputs) > 1:
            raise Problem(("observers", jumping[0].label), "of a stream it can follow a single output")
        start = Start(numbers.z0[:, None], numbers.p[:, None], (_LARGEST, 0.0))
        program = structure.program(experiment.blocks.solver.given_method)
        slots = len(model.outputs) * (_LATE + 1)
        self._reach = _FARTHEST * nominal_step(experiment)
        self._live = Live(program, start, 0.0, slots, nominal_step(experiment), _TOGETHER)
        self._kinds = Kinds.of(structure, self._corrections, len(self._inputs), _LATE)
        self._rows: dict[object, Integers] = {}

    @property
    def t(self) -> float:
        """The time of the last event."""
        return self._experiment.origin + self._live.t

    @property
    def states(self) -> tuple[str, ...]:
        """Names of what is estimated."""
        return self._experiment.plant.model.states

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the observers."""
        return tuple(self._labels)

    @property
    def any_lost(self) -> bool:
        """Whether one of the observers has no numbers any more."""
        return bool(self._live.diverged.min() < np.inf)

    @property
    def lost(self) -> dict[str, bool]:
        """Which observers have no numbers any more."""
        return {label: bool(at < np.inf) for label, at in zip(self._labels, self._live.diverged.tolist(), strict=True)}

    def estimate(self) -> dict[str, Floats]:
        """xhat of every observer at the last event, by label, shape (n,) each."""
        z, found = self._live.z, {}
        for label, readout in zip(self._labels, self._structure.estimates, strict=True):
            if readout.places is not None:
                found[label] = z[readout.places]
            else:
                w = self._live.w if readout.function.size1_in(3) else np.zeros(0)
                found[label] = evaluate(readout.function, np.array([self._live.t]), self._p, z, w)[0][0]
        return found

    def predict(self, t: float) -> dict[str, Floats]:
        """xhat of every observer at a time that is not before the last event; nothing follows from it.

        Raises
        ------
        ValueError
            For an earlier time.
        """
        ahead = self._since_start(t)
        if ahead == self._live.t:
            return self.estimate()
        kept = self._live.state()
        self._live.advance(ahead, self._regime[tuple(self._heard)])
        found = {label: np.array(values) for label, values in self.estimate().items()}
        self._live.restore(kept)
        return found

    def require_reachable(self, t: float) -> None:
        """Refuse a time that is before the last event, or so far ahead that it is of another clock.

        Raises
        ------
        ValueError
        """
        self._since_start(t)

    def _since_start(self, t: float, name: str = "t") -> float:
        t = as_number(name, t)
        since = t - self._experiment.origin
        if not since >= self._live.t:  # NaN, too
            raise ValueError(f"t = {t:g} is before {self.t:g}, which has been reached")
        if since - self._live.t > self._reach:
            raise ValueError(
                f"t = {t:g} is more than {_FARTHEST:.0e} steps after {self.t:g}: time.start may be missing"
            )
        return since

    def _output(self, name: str) -> int:
        if name not in self._outputs:
            raise ValueError(f"no output is called {name!r}; there are {', '.join(self._outputs)}")
        return self._outputs[name]

    def update(
        self,
        t: float,
        y: Mapping[str, float],
        available: float | None = None,
        u: Mapping[str, float] | None = None,
    ) -> None:
        """Take samples, and go on to when they are known.

        Parameters
        ----------
        t : float
            When they were taken.
        y : mapping of str to float
            By output; what is not finite is missing.
        available : float, optional
            When they are known, if that is later than ``t``.
        u : mapping of str to float, optional
            Inputs from then on.

        Raises
        ------
        ValueError
            For a time that has passed, and for names that are unknown.
        TypeError
            For what is no number, or no mapping.
        """
        t = as_number("t", t)
        values = [(self._output(name), value) for name, value in numbers_by_name("y", y)]
        values = sorted((i, value) for i, value in values if np.isfinite(value))
        changed = () if u is None else tuple((self._input(name), value) for name, value in numbers_by_name("u", u))
        if available is None or available == t:
            now = self._since_start(t)
            samples = tuple((i, i * (_LATE + 1), value, now >= self._newest[i]) for i, value in values)
            self._go_on(_Event(now, tuple((i, slot) for i, slot, _, _ in samples), samples, changed, now))
            return
        now, taken = self._since_start(available, "available"), t - self._experiment.origin
        if taken > now:
            raise ValueError(f"taken at {t:g}, after it was known at {available:g}")
        if taken < now and not self._by_innovation(t):
            if "replay" in self._treatments.values():
                slots = tuple((i, i * (_LATE + 1)) for i, _ in values)
                samples = tuple((i, slot, value, True) for (i, slot), (_, value) in zip(slots, values, strict=True))
                self._go_back(_Event(taken, slots, samples, (), taken), together=True)
            self._go_on(_Event(now, (), (), changed, now))
            return
        slots = tuple((i, self._next_slot(i)) for i, _ in values)
        self._go_back(_Event(taken, slots))
        used = tuple((i, slot, v, taken >= self._newest[i]) for (i, slot), (_, v) in zip(slots, values, strict=True))
        self._go_on(_Event(now, (), used, changed, taken))

    @property
    def kinds(self) -> dict[str, int]:
        """The numbers of outputs and of inputs that come with samples, for :meth:`update_many`; by name."""
        found = dict(self._outputs)
        return found | {name: len(self._outputs) + i for name, i in self._inputs.items() if name not in found}

    def at_once(self, t: Floats, kinds: Integers) -> int:
        """How many of some samples, from the first on, :meth:`update_many` may take together.

        It cannot take samples of an output that has not been heard before, and none where something is decided in
        between: with gates, with samples that may come late, and for observers that step from sample to sample.

        Parameters
        ----------
        t : ndarray, shape (N,)
        kinds : ndarray of int, shape (N,)
            What each is of, see :attr:`kinds`.
        """
        if not self._simple:
            return 0
        heard = np.array([*self._heard, *([True] * len(self._inputs))])
        since = t - self._experiment.origin
        fits = heard[kinds] & (since >= np.append(self._live.t, since[:-1]))
        fits &= np.diff(since, prepend=self._live.t) <= self._reach  # one further off is refused by `update`
        count = len(fits) if fits.all() else int(np.argmin(fits))
        return min(count, _TOGETHER)

    def update_many(self, t: Floats, kinds: Integers, values: Floats) -> dict[str, tuple[Floats, np.ndarray]]:
        """Take samples that are known when they are taken, with the bits of one :meth:`update` after the other.

        Parameters
        ----------
        t, kinds, values : ndarray, shape (N,)
            As many as :meth:`at_once` allows; values are numbers.

        Returns
        -------
        dict of str to (ndarray, ndarray of bool)
            By observer xhat after every sample, shape (N, n), and whether it had no numbers any more, shape (N,).
        """
        since = t - self._experiment.origin
        rows = self._kinds.carry_out(self._live, self._regime[tuple(self._heard)], since, kinds, values, _LATE)
        for i in range(len(self._outputs)):
            own = since[kinds == i]
            if own.size:
                self._newest[i] = float(own[-1])
        lost = self._live.diverged[:, None] <= since
        readouts = zip(self._labels, self._structure.estimates, lost, strict=True)
        return {label: (readout.along(since, self._p, rows), gone) for label, readout, gone in readouts}

    def _by_innovation(self, t: float) -> bool:
        """Whether late samples enter the innovation of all observers; otherwise all go back, or none takes them."""
        found = {treatment: label for label, treatment in self._treatments.items()}
        if len(found) > 1:
            said = ", ".join(f"{label}: {treatment}" for treatment, label in found.items())
            raise ValueError(
                f"the sample taken at {t:g} is late, and in a stream all observers treat late samples alike ({said})"
            )
        if "replay" in found and self._gate is not None:
            raise ValueError(f"the sample taken at {t:g} is late: with a gate late samples enter the innovation alone")
        return "innovation" in found

    def _input(self, name: str) -> int:
        if name not in self._inputs:
            known = ", ".join(self._inputs) or "none"
            raise ValueError(f"the input {name!r} is not given with samples; those that are: {known}")
        return self._inputs[name]

    def _next_slot(self, output: int) -> int:
        """A place for a late sample: one after the other, around."""
        self._pending[output] = self._pending[output] % _LATE + 1
        return output * (_LATE + 1) + self._pending[output]

    def _go_on(self, event: _Event) -> None:
        """Carry an event out, and remember it."""
        if self._remembers:
            self._before.append((self._live.state(), self._notes()))
            self._events.append(event)
        self._carry_out(event)

    def _go_back(self, event: _Event, *, together: bool = False) -> None:
        """Let something happen at an earlier time: from there all is carried out again.

        Parameters
        ----------
        together : bool
            With samples of other outputs that were taken at the same time, as if they had come at once.
        """
        place = bisect_right([one.t for one in self._events], event.t)
        other = self._beside(event, place) if together else None
        if event.t >= self._live.t and other is None:
            self._go_on(event)
            return
        if event.t < (float(self._before[0][0]["t"][0]) if self._before else self._live.t):
            raise ValueError(
                f"a sample taken at {self._experiment.origin + event.t:g} is older than all that is remembered: "
                "increase remembered"
            )
        again = [event, *list(self._events)[place:]]
        if other is not None:
            again = list(self._events)[other:]
            again[0], place = again[0].joined(event), other
        if place < len(self._events):
            state, notes = self._before[place]
            pending = self._pending
            self._live.restore(state)
            self._restore_notes(notes)
            self._pending = pending  # no slot of a sample that is on its way is given to another
            for _ in range(place, len(self._events)):
                self._events.pop()
                self._before.pop()
        for one in again:
            self._go_on(one)

    def _beside(self, event: _Event, place: int) -> int | None:
        """Among the events before ``place`` one at the same time with samples of other outputs alone."""
        own = {i for i, *_ in event.samples}
        for number in range(place - 1, -1, -1):
            one = self._events[number]
            if one.t != event.t:
                return None
            if one.samples and own.isdisjoint(i for i, *_ in one.samples):
                return number
        return None

    def _carry_out(self, event: _Event) -> None:
        live = self._live
        live.advance(event.t, self._regime[tuple(self._heard)])
        layout = self._structure.system.held
        for number, value in event.inputs:
            place, slope, since, _ = layout.input(number)
            live.w[place], live.w[slope], live.w[since] = value, 0.0, event.t
        if not (event.take or event.samples):
            return
        for _, slot, value, _ in event.samples:
            live.samples[slot] = value
        jumps = self._jumps(event)
        gated = self._gate is not None and any(self._gated[i] and used for i, _, _, used in event.samples)
        z, w = (live.z.copy(), live.w.copy()) if gated else (live.z, live.w)
        fresh = [layout.fresh(i) for i, _, _, used in event.samples if used and layout.flags]
        live.w[fresh] = 1.0
        live.happen(self._actions(event, jumps), self._regime[tuple(self._heard)])
        live.w[fresh] = 0.0
        for i, slot, _, used in event.samples:
            if used:
                self._heard[i] = True
                self._newest[i] = event.taken
                if self._gate is not None and self._gated[i]:
                    for j in self._gate.outliers(i, live.innovations[slot], event.t, z, w):
                        leave_out(self._structure.system, live, i, j, z, w)

    def _jumps(self, event: _Event) -> list[int]:
        """What jumps at an event: corrections whenever something arrives, steps from the second sample on."""
        if not any(used for _, _, _, used in event.samples):
            return []
        found = list(self._corrections)
        if self._steps:
            if not np.isnan(self._last_sample):
                self._live.w[self._structure.system.held.interval] = event.t - self._last_sample
                found = self._steps + found
            self._last_sample = event.t
        return found

    def _actions(self, event: _Event, jumps: list[int]) -> Integers:
        """Rows of the engine's action table, in their order; kept, since few of them differ."""
        key = (event.take, tuple((i, slot, used) for i, slot, _, used in event.samples), tuple(jumps))
        if key not in self._rows:
            rows = [(TAKE, i, slot, 0, 0) for i, slot in event.take]
            rows += [(ARRIVE if used else RECORD, i, slot, 0, 0) for i, slot, _, used in event.samples]
            if self._structure.system.has_alpha:
                for i, _, _, used in event.samples:
                    if used:
                        first = i * (_LATE + 1)
                        rows.append((REBASE, i, 0, first + 1, first + 1 + _LATE))
            rows += [(JUMP, number, 0, 0, 0) for number in jumps]
            if len(self._rows) > 1000:
                self._rows.clear()
            self._rows[key] = np.array(rows, dtype=np.int64)
        return self._rows[key]

    def _notes(self) -> bytes:
        """What is known beside the numbers of the run."""
        gate = None if self._gate is None else [[one.state() for one in row] for row in self._gate.deviations]
        return json.dumps([self._heard, self._newest, self._pending, self._last_sample, gate]).encode()

    def _restore_notes(self, notes: bytes) -> None:
        self._heard, self._newest, self._pending, self._last_sample, gate = json.loads(notes)
        if self._gate is not None and gate is not None:
            for row, kept in zip(self._gate.deviations, gate, strict=True):
                for one, innovations in zip(row, kept, strict=True):
                    one.restore(innovations)

    def _identity(self) -> str:
        """What a checkpoint has to be of: the configuration, and which inputs are given."""
        text = self._experiment.resolved_text + json.dumps(sorted(self._inputs))
        return hashlib.sha256(text.encode()).hexdigest()

    def checkpoint(self) -> bytes:
        """All that the estimator goes on from, with what is remembered for samples that come late."""
        states: dict[str, Any] = {name: values[None] for name, values in self._live.state().items()}
        for name in states:
            states[name] = np.concatenate([states[name], *(state[name][None] for state, _ in self._before)])
        file = io.BytesIO()
        np.savez(file, **states)
        events = [[one.t, one.take, one.samples, one.inputs, one.taken] for one in self._events]
        told = [self._notes().decode(), [notes.decode() for _, notes in self._before], events]
        notes = json.dumps(told).encode()
        head = json.dumps({"of": self._identity(), "notes": len(notes)}).encode()
        return _MAGIC + head + b"\n" + notes + file.getvalue()

    def restore(self, checkpoint: bytes | bytearray) -> None:
        """Go on from a checkpoint of the same configuration.

        Raises
        ------
        HgorunError
            When it is none, or one of another configuration.
        TypeError
            When it is no bytes at all.
        """
        if not isinstance(checkpoint, bytes | bytearray):
            raise TypeError(f"checkpoint: expected the bytes of checkpoint(), found {checkpoint!r:.50}")
        if not checkpoint.startswith(_MAGIC):
            raise ConfigError("this is no checkpoint of an estimator, or one of another version")
        try:
            head, rest = checkpoint[len(_MAGIC) :].split(b"\n", 1)
            told = json.loads(head)
            if told["of"] != self._identity():
                raise ConfigError("the checkpoint is of another configuration")
            size = int(told["notes"])
            with np.load(io.BytesIO(rest[size:]), allow_pickle=False) as arrays:
                states = {name: np.array(arrays[name], dtype=float) for name in arrays.files}
            now, before, events = json.loads(rest[:size])
            remembered = [{name: values[k + 1] for name, values in states.items()} for k in range(len(before))]
            known = deque((_event_of(*one) for one in events), self._events.maxlen)
            kept = deque(zip(remembered, (notes.encode() for notes in before), strict=True), self._before.maxlen)
            self._restore_notes(now.encode())
            self._live.restore({name: values[0] for name, values in states.items()})
            self._events, self._before = known, kept
        except HgorunError:
            raise
        except Exception as error:
            raise ConfigError(f"the checkpoint is damaged: {error}") from error


def _event_of(
    t: float, take: list[list[int]], samples: list[list[Any]], inputs: list[list[Any]], taken: float
) -> _Event:
    """An event from the lists of a checkpoint."""
    return _Event(
        t,
        tuple((int(i), int(slot)) for i, slot in take),
        tuple((int(i), int(slot), float(value), bool(used)) for i, slot, value, used in samples),
        tuple((int(i), float(value)) for i, value in inputs),
        taken,
    )
