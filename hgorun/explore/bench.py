"""A configuration on the bench: what it shows with other values, and what has been computed of that before."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from hgorun.analysis.reasons import outcome
from hgorun.analysis.subject import Context, Subject
from hgorun.errors import ConfigError, HgorunError
from hgorun.explore.knobs import Knob, by_name, knobs_of
from hgorun.explore.promises import Promise, promise_of
from hgorun.explore.state import State, from_query
from hgorun.memo import Memo
from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.outcome import since_start
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared

_PROMISES = 256  # that are kept: of an observer that has not changed nothing is computed again


@dataclass(frozen=True, eq=False)
class Shown:
    """A state and what it comes to."""

    state: State
    run: PreparedRun
    result: Result

    @cached_property
    def context(self) -> Context:
        """What the theory looks at."""
        return Context(self.run, since_start(self.run, self.result))

    @property
    def experiment(self) -> Experiment:
        return self.run.experiment


@dataclass(frozen=True, eq=False)
class Bench:
    """A configuration and everything on it that can be varied.

    Attributes
    ----------
    path : Path
        The file, as it was named.
    base : Experiment
        What it says, with ``--set`` and ``--seed``.
    run_name : str or None
        Which of its runs it is, where it has several.
    """

    path: Path
    base: Experiment
    run_name: str | None = None
    _promises: Memo[Promise] = field(default_factory=lambda: Memo(_PROMISES), repr=False)

    @cached_property
    def knobs(self) -> Mapping[str, Knob]:
        """By name, in the order of the page."""
        return by_name(knobs_of(self.base))

    @property
    def labels(self) -> tuple[str, ...]:
        """Of all observers of the file."""
        return tuple(self.base.observers)

    @property
    def name(self) -> str:
        """What files of it are called."""
        return self.path.stem if self.run_name is None else f"{self.path.stem}-{self.run_name}"

    def state_of(self, query: str) -> State:
        """What an address stands for.

        Raises
        ------
        ConfigError
        """
        return from_query(query, self.knobs, self.labels)

    def experiment(self, state: State) -> Experiment:
        """The configuration of a state.

        Raises
        ------
        ConfigError
            When a value does not fit.
        """
        changes = state.changes(self.knobs)
        return self.base.varied(changes) if changes else self.base

    def prepared(self, state: State) -> PreparedRun:
        """The run of a state, before its first step.

        Raises
        ------
        ConfigError
            When something does not fit together.
        """
        return prepare(self.experiment(state))

    def simulated(self, state: State, run: PreparedRun | None = None) -> Shown:
        """What a state comes to.

        Raises
        ------
        ConfigError
            When something does not fit together.
        SimulationError
            When the plant diverges.
        """
        run = self.prepared(state) if run is None else run
        return Shown(state, run, simulate_prepared(run))

    def promise(self, shown: Shown, label: str) -> Promise:
        """What the theory says of an observer of a run; a reason where it says nothing."""
        if shown.experiment.closed:
            return Promise(reason="in a closed loop the inputs follow from the estimates; the theorems are about "
                           "inputs that are functions of time")  # fmt: skip
        subject = shown.context.subjects[label]
        return self._promises.get(_key(subject), lambda: _promised(subject))


def _promised(subject: Subject) -> Promise:
    def found() -> Promise:
        with subject.run.experiment.located():
            return promise_of(subject)

    try:
        made = outcome(found)
    except HgorunError as error:
        return Promise(reason=str(error))
    return made.found if made.found is not None else Promise(reason=made.reason or "")


def _key(subject: Subject) -> str:
    """What an observer's theory depends on: its own block, everything but the other observers, and its run."""
    data = subject.run.experiment.source.data
    own = {key: part for key, part in data.items() if key not in ("observers", "figures", "claims", "title")}
    text = json.dumps([own, subject.label, data["observers"][subject.label], subject.run.step], sort_keys=True)
    digest = hashlib.sha256(text.encode())
    for values in (subject.result.x, subject.found.xhat):
        digest.update(values.tobytes())
    return digest.hexdigest()


def recorded(experiment: Experiment) -> ConfigError | None:
    """Why a configuration of recorded data is not shown; None for others."""
    if experiment.blocks.data is None:
        return None
    return ConfigError(
        "the block data is of recorded measurements, beside which there is no truth to show errors against: "
        "hgorun estimate carries the observers along them, and reports how its scores depend on each gain",
        key="data",
    )
