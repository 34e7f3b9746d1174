"""Simulated plants on the bench, beside what the theory says of their observers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from hgorun.analysis.reasons import outcome
from hgorun.analysis.subject import Context, Subject
from hgorun.config.yaml_source import Source
from hgorun.errors import HgorunError
from hgorun.explore.bench import Bench, Ready, Shown
from hgorun.explore.knobs import Knob, knobs_of
from hgorun.explore.plant_knobs import of_plant
from hgorun.explore.promises import Promise, compile_theory, numbers_of, promise_of
from hgorun.explore.state import State
from hgorun.memo import Memo
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.experiment.resolved import as_yaml
from hgorun.simulation.known import Known
from hgorun.simulation.outcome.outcome import since_start
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared

_NEAR = 1, -1, 2  # steps of an order that are carried out before they are asked for
_FAR = 10  # up to which they are compiled
_AHEAD = *_NEAR, -2, *(sign * step for step in range(3, _FAR + 1) for sign in (1, -1))
_PROMISES = 256  # that are kept: of an observer that has not changed nothing is computed again


@dataclass(frozen=True, eq=False)
class Simulated(Shown):
    """A simulated state."""

    run: PreparedRun

    @cached_property
    def subjects(self) -> Mapping[str, Subject]:
        """What the theory looks at, by observer; what it has found of one is kept with it."""
        return Context(self.run, since_start(self.run, self.result)).subjects

    @cached_property
    def keys(self) -> dict[str, bytes]:
        """By observer, what its theory depends on."""
        return {label: _key(subject) + self.contents[label] for label, subject in self.subjects.items()}


@dataclass(frozen=True, eq=False)
class SimulatedBench(Bench):
    """A configuration whose plant is simulated."""

    _promises: Memo[Promise] = field(default_factory=lambda: Memo(_PROMISES), repr=False)
    _known: Known = field(default_factory=Known, repr=False)
    _tried: set[tuple[str, float]] = field(default_factory=set, repr=False)

    theory = True

    def _knobs(self) -> Sequence[Knob]:
        return [*knobs_of(self.base), *of_plant(self.base)]

    def ready(self, state: State) -> Ready:
        run = self._prepared(state)
        experiment = run.experiment
        return Ready(
            self._known.compiled(run),
            lambda progress: Simulated(
                state, experiment.source, experiment, simulate_prepared(run, progress=progress, known=self._known), run
            ),
        )

    def _prepared(self, state: State) -> PreparedRun:
        changes = state.changes(self.knobs)
        return prepare(self.base.varied(changes) if changes else self.base)

    def look_ahead(self, shown: Shown) -> bool:
        """Compile something that may be asked for; False: there is nothing more.

        At first what each observer needs to be integrated alone, and its theory; then orders, of which each is new
        code: those that are near are carried out, beside what the theory says of them.
        """
        simulated = _of(shown)
        if self._known.compile_next(simulated.run):
            return True
        if any(map(compile_theory, simulated.subjects.values())):
            return True
        orders = [k for k in self.knobs.values() if k.scale == "integer" and k.group in shown.result.observers]
        for step in _AHEAD:
            for knob in orders:
                value = shown.state.values.get(knob.name, knob.start) + step
                if (knob.name, value) not in self._tried and knob.low <= value <= knob.high:
                    self._tried.add((knob.name, value))
                    with suppress(HgorunError):  # it is told where it is asked for
                        self._try(shown.state.with_value(knob, value), knob.group, near=step in _NEAR)
                    return True
        return False

    def _try(self, state: State, label: str, *, near: bool) -> None:
        """Carry out a state, or only compile what it needs."""
        if near:
            self.promise(self.shown(state), label)
        else:
            self._known.compile_next(self._prepared(state))

    def text(self, shown: Shown, target: Path) -> str:
        said = {key: part for key in ("title", "reference") if (part := shown.said.data.get(key))}
        return as_yaml(said | shown.experiment.resolved())

    def says(self, source: Source, file: Path) -> Mapping[str, object]:
        return Experiment(source).resolved()

    def known(self, shown: Shown, label: str) -> bool:
        return shown.experiment.closed or _of(shown).keys[label] in self._promises

    def promise(self, shown: Shown, label: str) -> Promise:
        if shown.experiment.closed:
            return Promise(reason="in a closed loop the inputs follow from the estimates; the theorems are about "
                           "inputs that are functions of time")  # fmt: skip
        simulated = _of(shown)
        return self._promises.get(simulated.keys[label], lambda: _promised(simulated.subjects[label]))

    def limits(self, shown: Shown, label: str, names: Sequence[str]) -> Promise:
        if shown.experiment.closed:
            return Promise()
        numbers, reasons = numbers_of(_of(shown).subjects[label], names)
        return Promise(numbers=numbers, reasons=reasons)


def _of(shown: Shown) -> Simulated:
    assert isinstance(shown, Simulated)
    return shown


def _promised(subject: Subject) -> Promise:
    def found() -> Promise:
        with subject.run.experiment.located():
            return promise_of(subject)

    try:
        made = outcome(found)
    except HgorunError as error:
        return Promise(reason=str(error))
    return made.found if made.found is not None else Promise(reason=made.reason or "")


def _key(subject: Subject) -> bytes:
    """What an observer's theory depends on beside truth and estimate: its block and all but the other observers."""
    data = subject.run.experiment.source.data
    own = {key: part for key, part in data.items() if key not in ("observers", "figures", "claims", "title")}
    text = json.dumps([own, subject.label, data["observers"][subject.label], subject.run.step], sort_keys=True)
    return hashlib.sha256(text.encode()).digest()
