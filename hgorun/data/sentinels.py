"""Numbers that loggers write where they have no value, such as -9999: told where nobody has said so."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.config.data import Column, Judged
from hgorun.data.recording import Note
from hgorun.data.samples import Samples

_USUAL = (99, 99.9, 99.99, 999, 999.9, 999.99, 6999, 7999, 9999, 9999.9, 99999, 999999, 9999999, 32767, 32768, 65535,
          2147483647, 2147483648, 1e20, 1e30, 9.96921e36, 9.969209968386869e36, 1e37)  # fmt: skip
_FEWEST = 3  # other values that show where a column lies
_BELOW, _BEYOND = 0.5, 2.0  # of the span of the others: so far off a negative one beside none is, and any


def sentinels(values: np.ndarray) -> Iterator[tuple[float, float, float]]:
    """Numbers in the list of usual ones that lie far outside of all others, with the ends of these.

    A measured value is exactly such a number by chance, and then its neighbours are near. Of a column that rests at one
    value a positive one may be a step of what is measured.
    """
    left = values
    for _ in range(2):  # at either end
        ends = (float(end.reduce(left, initial=np.nan)) for end in (np.fmin, np.fmax))  # but for missing ones
        found = next((end for end in ends if _is_usual(end)), None)
        if found is None:
            return
        others = left[(left != found) & ~np.isnan(left)]
        if others.size < _FEWEST:
            return
        low, high = float(others.min()), float(others.max())
        off = max(low - found, found - high)
        alone = found < 0 <= low
        if off > (_BELOW if alone else _BEYOND) * (high - low) and (alone or high > low):
            yield found, low, high
        left = others


def _is_usual(number: float) -> bool:
    return any(abs(abs(number) - usual) <= 1e-6 * usual for usual in _USUAL)


def told(samples: Samples, written: np.ndarray, block: Column, owner: str) -> Iterator[Note]:
    """What is told of such numbers that are taken as values.

    Parameters
    ----------
    samples : Samples
        With values in the unit of the model.
    written : ndarray, shape (n,)
        As the file has them.
    block : Column
    owner : str
        The key below which ``csv`` says how the file is written.
    """
    good = np.ones(written.size, dtype=bool) if samples.good is None else samples.good != 0
    plausible = block.plausible if isinstance(block, Judged) else None
    if plausible is not None:
        good &= (samples.values >= plausible[0]) & (samples.values <= plausible[1])
    for number, low, high in sentinels(np.where(good, written, np.nan) if not good.all() else written):
        places = np.flatnonzero(good & (written == number))
        file, line = samples.place(int(places[0]))
        times = "1 value is" if places.size == 1 else f"{places.size:,} values are"
        said = (
            f"{times} {number:.15g}, far outside of the others ({low:.6g} to {high:.6g}), and taken as measured: if "
            f"that means a missing value: csv: {{missing: [{number:.15g}]}}; csv goes below {owner}"
        )
        yield Note(kind="sentinel", signal=samples.key, file=file, line=line, count=places.size, message=said)
