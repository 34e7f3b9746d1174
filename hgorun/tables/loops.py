"""Closed loops in tables: what every observer asks of the inputs, beside state feedback."""

from __future__ import annotations

from typing import Any

from hgorun.result.records.data import PLANT
from hgorun.result.result import Result
from hgorun.tables.layout import number, packed
from hgorun.tables.typeset import printable

REFERENCE = "state feedback"


def loop_numbers(result: Result, label: str) -> dict[str, Any]:
    """Effort and peak of every input, and the cost where there is one, as JSON holds them."""
    loop = result.closed_loop[label]
    found: dict[str, Any] = {
        name: dict(zip(result.inputs, map(float, values), strict=True))
        for name, values in (("effort", loop.effort), ("peak_input", loop.peak_input))
    }
    return found if loop.cost is None else found | {"cost": loop.cost}


def loop_blocks(result: Result) -> list[list[str]]:
    """The same as lines of a table."""
    loops = [*(label for label in result.closed_loop if label != PLANT), PLANT]
    of = [result.closed_loop[label] for label in loops]
    columns = [["cost", *(number(loop.cost) for loop in of)]] if of[0].cost is not None else []
    for k, name in enumerate(result.inputs):
        columns.append([f"effort {printable(name)}", *(number(float(loop.effort[k])) for loop in of)])
        columns.append([f"peak {printable(name)}", *(number(float(loop.peak_input[k])) for loop in of)])
    return packed([REFERENCE if label == PLANT else printable(label) for label in loops], [[c] for c in columns])
