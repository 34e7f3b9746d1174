"""What gates have left out of a stream, by the names of observers and outputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hgorun.config.named import Named
from hgorun.estimate.stream.following import Following

_Count = TypeVar("_Count")


def by_gate(run: Following, of: Callable[[int, int], _Count]) -> dict[str, dict[str, _Count]]:
    """What is counted of each output with a gate, by its number and that of an observer."""
    limited = {name: i for name, i in run.system.outputs.items() if run.limited[i]}
    found = {
        label: Named({name: of(i, j) for name, i in limited.items()}, "output with a gate")
        for j, label in enumerate(run.system.labels)
    }
    return Named(found, "observer")
