"""What is told of the numbers of an exported observer: their units, and where it starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.export.observer import Exported

_BEGUN = {"sample": "from the first sample of the log", "model": "by the model from the first samples of the log"}


def units_said(observer: Exported) -> Iterator[str]:
    """A sentence for what it is told and one for its estimates, where units are known."""
    groups: dict[str, Sequence[str]] = {
        "y": [output.name for output in observer.outputs],
        "u": observer.inputs,
        "xhat": observer.states,
    }
    for group, names in groups.items():
        if known := [f"{name} in {unit}" for name in names if (unit := unit_of(observer, name))]:
            yield f"Units of {group}: {', '.join(known)}; nothing is converted."


def unit_of(observer: Exported, name: str) -> str:
    """The unit of a state, an output or an input; empty where the model does not say it."""
    unit = observer.plant.units.get(name, "")
    return "" if unit == "1" else unit


def start_of(observer: Exported, state: str) -> str:
    """Where the estimate of a state starts, in words; empty where the configuration says it."""
    return _BEGUN[observer.begun[state]] if state in observer.begun else ""


def starts(observer: Exported) -> str:
    """What starts from a log, as "a = 0.3 from the first sample of the log"; empty where nothing does."""
    initial = observer.design.observer.initial
    told = [(state, initial.get(state, 0.0), start_of(observer, state)) for state in observer.states]
    return ", ".join(f"{state} = {value:.6g} {how}" for state, value, how in told if how)
