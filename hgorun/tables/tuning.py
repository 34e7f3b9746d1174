"""What a tuning has found, as text and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.files import json_value
from hgorun.tables.axis_names import bracketed, short_axis, unit_of_axis
from hgorun.tables.layout import number, packed, wrapped
from hgorun.tables.uncertain import uncertain

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class TunedTable:
    """The front of an observer.

    Attributes
    ----------
    label : str
        The observer, or what its task is called.
    paths, quantities : tuple of str
        Of the gains; goals, then limits.
    goals : int
        How many of the quantities are minimised.
    gains : ndarray, shape (F, k)
    tuned, tuned_half : ndarray, shape (F, q)
        Means over the seeds of the search, and half the widths of their 95 % intervals.
    held_out, held_out_half : ndarray, shape (F, q)
        The same over the held-out seeds.
    lost : ndarray of int, shape (F,)
        Held-out seeds with which an estimate was lost.
    confidence : ndarray, shape (F,)
    chosen : int
        The knee, or the minimum.
    runs, budget, seeds, held_out_seeds : int
        How many.
    units : tuple of str
        Of the quantities; empty where they are not known.
    of_gains : mapping of str to str
        Units of time, and of gains that are no times.
    ended : str
        Why so many of the budget's runs are left; nothing where only a few are.
    """

    label: str
    paths: tuple[str, ...]
    quantities: tuple[str, ...]
    goals: int
    gains: Floats
    tuned: Floats
    tuned_half: Floats
    held_out: Floats
    held_out_half: Floats
    lost: NDArray[np.int64]
    confidence: Floats
    chosen: int
    runs: int
    budget: int
    ended: str
    seeds: int
    held_out_seeds: int
    units: tuple[str, ...] = ()
    of_gains: Mapping[str, str] = field(default_factory=dict)

    @property
    def units_of_gains(self) -> dict[str, str]:
        """Units of those gains that have one, by their paths."""
        return {path: unit for path in self.paths if (unit := unit_of_axis(path, self.of_gains))}

    @property
    def units_of_quantities(self) -> dict[str, str]:
        """Units of quantities by their texts, where they are known."""
        return {text: unit for text, unit in zip(self.quantities, self.units, strict=False) if unit}


def text(found: Sequence[TunedTable]) -> str:
    """A table for each observer, a row for each point of its front."""
    lines: list[str] = []
    for one in found:
        what = "the least" if one.goals == 1 else "the front, * the knee"
        runs = f"{one.runs} of {one.budget} runs over {one.seeds} seeds"
        head = f"{one.label}: {runs}; {what}, on {one.held_out_seeds} held-out seeds"
        lines += [*([""] if lines else []), *wrapped(head)]
        lines += wrapped(f"the search ended before its budget: {one.ended}") if one.ended else []
        rows = ["*" if i == one.chosen else "" for i in range(len(one.gains))]
        of_gains, of_quantities = one.units_of_gains, one.units_of_quantities
        columns = [
            [short_axis(path, one.paths) + bracketed(of_gains.get(path, "")), *map(number, one.gains[:, k])]
            for k, path in enumerate(one.paths)
        ]
        for k, quantity in enumerate(one.quantities):
            values = zip(one.held_out[:, k], one.held_out_half[:, k], strict=True)
            cells = [uncertain(float(mean), float(half)) for mean, half in values]
            columns.append([quantity + bracketed(of_quantities.get(quantity, "")), *cells])
        if one.goals > 1:
            columns.append(["confidence", *(f"{100 * c:.0f} %" for c in one.confidence)])
        if one.lost.any():
            columns.append(["lost", *map(str, one.lost)])
        for block in packed(rows, [[column] for column in columns]):
            lines += ["", *block]
    return "\n".join(lines)


def as_json(found: Sequence[TunedTable], name: str, files: Sequence[str]) -> dict[str, Any]:
    """``{name, files, observers: {label: {runs, budget, ended, seeds, held_out, gains, chosen, front: [{gains, tuned,
    held_out, confidence, lost}]}}}``; quantities are ``{text: {mean, ci95}}``.

    An observer has ``units``, too: of its gains and quantities, where they are known.
    """
    observers = {}
    for one in found:
        front = [
            {
                "gains": dict(zip(one.paths, one.gains[i].tolist(), strict=True)),
                "tuned": _quantities(one, one.tuned[i], one.tuned_half[i]),
                "held_out": _quantities(one, one.held_out[i], one.held_out_half[i]),
                "confidence": float(one.confidence[i]),
                "lost": int(one.lost[i]),
            }
            for i in range(len(one.gains))
        ]
        observers[one.label] = {
            "runs": one.runs,
            "budget": one.budget,
            "ended": one.ended or None,
            "seeds": one.seeds,
            "held_out": one.held_out_seeds,
            "units": one.units_of_gains | one.units_of_quantities,
            "gains": front[one.chosen]["gains"],
            "chosen": one.chosen,
            "front": front,
        }
    whole: dict[str, Any] = {"name": name, "files": list(files), "observers": observers}
    return {key: json_value(value) for key, value in whole.items()}


def _quantities(one: TunedTable, means: Floats, halves: Floats) -> dict[str, Any]:
    return {
        quantity: {"mean": float(mean), "ci95": None if np.isnan(half) else [float(mean - half), float(mean + half)]}
        for quantity, mean, half in zip(one.quantities, means, halves, strict=True)
    }
