"""Angles that jump by a whole turn where the model does not say that they are known up to whole turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.data.recording import Note
from hgorun.data.samples import Samples

_TURNS = {
    **dict.fromkeys(("rad", "radian", "radians"), 2 * np.pi),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), 360.0),
    **{"mrad": 2000 * np.pi, "turn": 1.0, "rev": 1.0, "gon": 400.0},
}  # a library of units takes longer to import than many a log to read
_FULL = 0.8  # of a turn: so much of it an angle has passed before it begins anew
_LIKE = 3.0  # times the largest other step: no step that is left at a jump is larger
_NEAR = 0.25  # of a turn: no step that is left without the jump is larger


def wrapped(samples: Samples, name: str, unit: str) -> Iterator[Note]:
    """That the values of an output begin anew after each turn, with the key that takes them so.

    Parameters
    ----------
    unit : str
        Of the model, in which the values are.
    """
    turn = _TURNS.get(unit)
    if turn is None:
        return
    known = np.flatnonzero(np.isfinite(samples.values))
    values = samples.values[known]
    jumps = np.flatnonzero(np.abs(np.diff(values)) > turn / 2) + 1
    span = np.ptp(values) if jumps.size else 0.0
    if not _FULL * turn < span <= turn * (1 + 1e-9):
        return
    steps = np.abs(np.diff(np.unwrap(values, period=turn)))
    others = np.delete(steps, jumps - 1)
    if steps.max() > _NEAR * turn or steps[jumps - 1].max() > _LIKE * others.max(initial=0.0):
        return  # samples so far apart, or of a switch, show no turn; a scanner flies back from any angle
    file, line = samples.place(int(known[jumps[0]]))
    times = "once" if jumps.size == 1 else f"{jumps.size:,} times"
    period = "2*pi" if unit.startswith("rad") else f"{turn:.12g}"
    message = (
        f"the values jump {times} by a whole turn of {turn:.6g} {unit}, as an angle that begins anew: "
        f"`period: {period}` of this output takes it so, plant.output: {{{name}: {{value: ..., period: ...}}}}"
    )
    yield Note(kind="wraps", signal=samples.key, file=file, line=line, count=int(jumps.size), message=message)
