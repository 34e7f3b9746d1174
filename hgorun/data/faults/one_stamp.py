"""A single time stamp that is too late, as one with a wrong month is."""

from __future__ import annotations

from hgorun.data.clocks import shown
from hgorun.data.recording import Origin
from hgorun.data.samples import Samples
from hgorun.data.times.date_order import out_of_order

_OTHERS = 3  # that are in order by more than chance
_RIGHT = "correct it, or take its row out"


def one_ahead(samples: Samples, back: int, origin: Origin) -> tuple[int, str, str] | None:
    """The sample, what is wrong with its stamp, and what is right; None where another one may be wrong.

    Parameters
    ----------
    samples : Samples
        In the order of the file.
    back : int
        The first one that lies before the one above it.
    origin : Origin
        Of their times.
    """
    if samples.taken.size <= _OTHERS or out_of_order(samples.taken) != [back - 1]:
        return None
    stamp = shown(float(samples.taken[back - 1]), origin, samples.time_unit)
    return back - 1, f"the time stamp {stamp} is later than stamps below it, and without it all are in order", _RIGHT
