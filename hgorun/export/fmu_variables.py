"""The variables of an observer as a co-simulation unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hgorun.export.observer import Exported
from hgorun.export.said import start_of, unit_of

Kind = Literal["time", "y", "new", "age", "u", "xhat"]


@dataclass(frozen=True)
class Variable:
    """A variable of the unit.

    Attributes
    ----------
    name : str
    number : int
        Its value reference.
    kind : str
        ``y``: what an output is; ``new``: whether it is a new sample; ``age``: how long ago that was taken; ``u``: an
        input; ``xhat``: an estimate.
    index : int
        Of which output, input or state.
    meaning : str
    """

    name: str
    number: int
    kind: Kind
    index: int
    meaning: str

    @property
    def is_boolean(self) -> bool:
        return self.kind == "new"

    @property
    def is_output(self) -> bool:
        return self.kind == "xhat"


def variables_of(observer: Exported) -> list[Variable]:
    """All variables, time first."""
    unit = observer.unit
    found: list[tuple[str, Kind, int, str]] = [("time", "time", 0, f"time of the simulation, in {unit}")]
    for i, output in enumerate(observer.outputs):
        found.append((f"y.{output.name}", "y", i, "output of the plant, as measured" + _in(observer, output.name)))
        if output.sampled:
            found.append((f"new.{output.name}", "new", i, "whether a sample arrives at the start of a step"))
        if output.late:
            found.append((f"age.{output.name}", "age", i, f"how long ago the sample was taken, in {unit}"))
    for i, name in enumerate(observer.inputs):
        found.append((f"u.{name}", "u", i, "input of the plant" + _in(observer, name)))
    for i, name in enumerate(observer.states):
        begun = start_of(observer, name)
        meaning = "estimate" + _in(observer, name) + (f"; starts {begun}" if begun else "")
        found.append((f"xhat.{name}", "xhat", i, meaning))
    return [Variable(name, number, kind, i, meaning) for number, (name, kind, i, meaning) in enumerate(found)]


def _in(observer: Exported, name: str) -> str:
    unit = unit_of(observer, name)
    return f", in {unit}" if unit else ""
