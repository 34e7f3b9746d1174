"""Why stamps run backwards or come again: another log behind the first, or dates without times.

To sort two logs would mix them, and of a day's samples one would be left.
"""

from __future__ import annotations

import numpy as np

from hgorun.data.faults.clock_changes import HourTwice
from hgorun.data.recording import Origin
from hgorun.data.samples import Samples
from hgorun.data.units.units import seconds

_FEW = 3  # samples on each side that are no chance
_NEAR = 0.05  # of the time that the log has lasted: so near its start the clock begins again
_DAY = 86400.0
_OF_DAYS = (
    "the stamps are dates without a time of day: if that is in a column of its own, data.time: {column: NAME, format: "
    "'%H:%M:%S', next_day: true} takes that one where no gap lasts a day; or write both into one column"
)


class Reasons:
    """Why samples of one signal run backwards or come again, where that is known: then something else is right.

    Parameters
    ----------
    origin : Origin
        Of their times.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin, self._twice, self._again = origin, HourTwice(origin), ""

    def told(self, samples: Samples, what: str, hint: str) -> tuple[str, str, str]:
        """What is wrong, what is right, and what a note says that is no refusal; once found, it is remembered.

        Parameters
        ----------
        samples : Samples
            In the order of the file, or of their times if they were told of before.
        what, hint : str
            What is said where no reason is known.
        """
        what, right, noted = self._twice.told(samples.taken, what, hint)
        if right != hint or not hint.startswith("faults: {"):  # the rows may be of several signals
            return what, right, noted
        if _of_days(samples.taken, self._origin):
            return what, _OF_DAYS, f"{what}; {_OF_DAYS}"
        k = begun_again(samples.taken, samples.values)
        if k is not None:
            self._again = _right(samples, k)
        if not self._again:
            return what, hint, what
        what += ", as if another log began, or another signal, whose clock begins again: sorting would mix the two"
        return what, self._again, f"{what}; {self._again}"


def begun_again(taken: np.ndarray, values: np.ndarray) -> int | None:
    """The sample with which the clock begins again; None where it does not, or where the same samples come again.

    Parameters
    ----------
    taken, values : ndarray, shape (n,)
        In the order of the file.
    """
    back = np.flatnonzero(taken[1:] < taken[:-1])[:2] + 1
    if not back.size:
        return None
    k, stop = int(back[0]), int(back[1]) if back.size > 1 else taken.size
    first, last = taken[0], taken[k - 1]
    again = taken[k:stop]
    within = int(np.count_nonzero((again >= first) & (again <= last)))
    if k < _FEW or within < _FEW or taken[k] - first > _NEAR * (last - first):
        return None
    place = np.minimum(np.searchsorted(taken[:k], again), k - 1)
    same = np.array_equal(taken[place], again) and np.array_equal(values[place], values[k:stop], equal_nan=True)
    return None if same else k


def _of_days(taken: np.ndarray, origin: Origin) -> bool:
    """Whether all stamps are dates at midnight, most of which come again."""
    if origin.epoch is None or 2 * np.count_nonzero(np.diff(taken) == 0) <= taken.size:
        return False
    start = (origin.epoch - origin.epoch.astype("datetime64[D]")) / np.timedelta64(1, "s")
    days = (start + taken * float(seconds(origin.unit, ("time", "unit")))) / _DAY
    return bool(np.allclose(days, np.rint(days), rtol=0, atol=1e-9))


def _right(samples: Samples, k: int) -> str:
    """What is right: each log in a run of its own, or one clock."""
    (before, _), (file, line) = samples.place(k - 1), samples.place(k)
    apart = f"give each file a run of its own, as by hgorun estimate CONFIG {file}"
    alone = apart if file != before else f"cut the file before line {line}, and give each part a run of its own"
    return f"{alone}, or let the times of the second go on behind those of the first"
