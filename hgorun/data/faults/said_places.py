"""How many samples have a fault, and where they stand, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from hgorun.data.faults.faults import Stretch
from hgorun.data.samples import Samples
from hgorun.pieces import extremes

_SHOWN = 5  # places of a fault whose lines are named


def samples_said(count: int, of_one: str = "", of_several: str = "") -> str:
    """One sample, or several, and what is said of that one, or of these."""
    return f"1 sample{of_one}" if count == 1 else f"{count:,} samples{of_several}"


def held_said(values: np.ndarray, found: Sequence[Stretch]) -> str:
    """What is said of stretches of equal values: of a sensor that is stuck, or of what rests or is at a limit, too.

    It rests at the least or the largest value, at one to which it comes again, or counts and never falls.
    """
    rows = "of equal values in a row" if len(found) == 1 else f"in {len(found):,} stretches of equal values"
    least, largest = extremes(values)
    held = Counter(float(values[stretch.start]) for stretch in found)
    comes_again = all(count > 1 or value in (least, largest) for value, count in held.items())
    if least < largest and (comes_again or bool(np.all(values[1:] >= values[:-1]))):
        return f"{rows}, as of a machine at rest, a limit, or a sensor that is stuck"
    return f"{rows}, as if the sensor were stuck"


def where(samples: Samples, places: Sequence[Stretch]) -> str:
    """The lines of the first places, where there are several or where one has several lines."""
    if len(places) == 1 and places[0].size == 1:
        return ""
    shown = [
        f"{samples.place(stretch.start)[1]}" + (f" to {samples.place(stretch.stop - 1)[1]}" if stretch.size > 1 else "")
        for stretch in places[:_SHOWN]
    ]
    more = f" and {len(places) - _SHOWN:,} more" if len(places) > _SHOWN else ""
    return f" (lines {', '.join(shown)}{more})"
