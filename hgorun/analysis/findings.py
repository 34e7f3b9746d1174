"""What contributors to an analysis take and give."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hgorun.result.result import Result
from hgorun.result.theory import Transient
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.simulation.prepared import PreparedRun


@dataclass(frozen=True)
class Context:
    """A run and its result.

    Attributes
    ----------
    run : PreparedRun
        ``run.experiment`` is what was configured.
    result : Result
    """

    run: PreparedRun
    result: Result

    @property
    def blocks(self) -> dict[str, ObserverBlock]:
        """Every observer with its form of the plant and its design, by label."""
        return {block.label: block for block in self.run.observers}


@dataclass
class Findings:
    """What is known of one observer, and why the rest is not.

    Attributes
    ----------
    values : dict
        Numbers, bools, arrays, complex arrays, or maps of them by state.
    reasons : dict of str to str
        Why a key has no value.
    remarks : list of str
    transient : Transient or None
        The error over time and its bound.
    """

    values: dict[str, Any] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    transient: Transient | None = None

    def give(self, **values: Any) -> None:
        """Values by their keys."""
        self.values.update(values)

    def add(self, other: Findings) -> None:
        """What another contributor found: its values in place of those that are missing or older."""
        for key, value in other.values.items():
            if value is not None or self.values.get(key) is None:
                self.values[key] = value
                self.reasons.pop(key, None)
        self.reasons.update({key: text for key, text in other.reasons.items() if self.values.get(key) is None})
        self.remarks += [text for text in other.remarks if text not in self.remarks]
        self.transient = other.transient or self.transient

    def withhold(self, reason: str, *keys: str) -> None:
        """Keys without a value, and why."""
        self.values.update(dict.fromkeys(keys))
        self.reasons.update(dict.fromkeys(keys, reason))


# {label: what it found}: of any of the observers, any keys
Contributor = Callable[[Context], Mapping[str, Findings]]
