"""How many samples have a fault, and where they stand, in words."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.data.faults.faults import Stretch
from hgorun.data.samples import Samples

_SHOWN = 5  # places of a fault whose lines are named


def samples_said(count: int) -> str:
    """One sample, or several."""
    return "1 sample" if count == 1 else f"{count:,} samples"


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
