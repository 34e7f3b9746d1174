"""A configuration on the bench: what of it can be varied, and what it comes to with other values."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from hgorun.config.yaml_source import Source
from hgorun.explore.knobs import Knob, by_name
from hgorun.explore.promises import Promise
from hgorun.explore.state import State, from_query
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment


@dataclass(frozen=True, eq=False)
class Shown:
    """A state and what it comes to.

    Attributes
    ----------
    state : State
    said : Source
        The configuration with its values.
    experiment : Experiment
        The same as a whole one.
    result : Result
    """

    state: State
    said: Source
    experiment: Experiment
    result: Result

    @cached_property
    def truths(self) -> dict[str | None, bytes]:
        """Digests of the simulated plant, under None, and of what each observer estimates."""
        result = self.result
        found: dict[str | None, bytes] = {None: _digest(result.time, result.x)}
        for label in result.observers:
            found[label] = _digest(result.time, result.truth_of(label)) if result.closed_loop else found[None]
        return found

    @cached_property
    def contents(self) -> dict[str, bytes]:
        """By observer, digests of its estimate and of what it estimates."""
        return {label: self.truths[label] + _digest(one.xhat) for label, one in self.result.observers.items()}


Progress = Callable[[float], None]  # told the completed fraction; what it raises ends what is computed


def unwatched(completed: float) -> None:
    """Nobody looks, and nothing is ended."""


@dataclass(frozen=True, eq=False)
class Ready:
    """What can be carried out: whether that needs new code, and how it is done."""

    compiled: bool
    carry_out: Callable[[Progress], Shown]


@dataclass(frozen=True, eq=False)
class Bench(ABC):
    """A configuration and everything on it that can be varied.

    Attributes
    ----------
    path : Path
        The file, as it was named.
    base : Experiment
        What it says, with ``--set`` and ``--seed``, as a whole one.
    run_name : str or None
        Which of its runs it is, where it has several.
    """

    path: Path
    base: Experiment
    run_name: str | None = None

    @cached_property
    def knobs(self) -> Mapping[str, Knob]:
        """By name, in the order of the page."""
        return by_name(tuple(self._knobs()))

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

    def shown(self, state: State) -> Shown:
        """What a state comes to; raises what :meth:`ready` and its carrying out raise."""
        return self.ready(state).carry_out(unwatched)

    @abstractmethod
    def _knobs(self) -> Sequence[Knob]:
        """All of them."""

    @abstractmethod
    def ready(self, state: State) -> Ready:
        """A state before its first step.

        Raises
        ------
        ConfigError
            When a value does not fit, or something does not fit together; carried out, also for a diverging plant
            (SimulationError).
        """

    @abstractmethod
    def text(self, shown: Shown, target: Path) -> str:
        """A state as the text of a whole configuration that is read from a folder; nothing above it is extended."""

    @abstractmethod
    def says(self, source: Source, file: Path) -> Mapping[str, object]:
        """Everything that decides the numbers of a configuration that stands at some place, to compare it.

        Raises
        ------
        ConfigError
        """

    def finished(self, shown: Shown) -> Shown | None:
        """The same with what takes long, once nothing else is asked for; None where there is no more."""
        return None

    def look_ahead(self, shown: Shown) -> bool:
        """Do something that takes long for the first time and may be asked for next; whether there was something."""
        return False

    # ---- theory, where there is some

    theory = False

    def known(self, shown: Shown, label: str) -> bool:
        """Whether what the theory says of an observer is known already."""
        return True

    def promise(self, shown: Shown, label: str) -> Promise:
        """What the theory says of an observer of a run; a reason where it says nothing."""
        return Promise()

    def limits(self, shown: Shown, label: str, names: Sequence[str]) -> Promise:
        """Findings that take longer, by their names."""
        return Promise()


def _digest(*arrays: np.ndarray) -> bytes:
    found = hashlib.sha256()
    for values in arrays:
        found.update(values.tobytes())
    return found.digest()
