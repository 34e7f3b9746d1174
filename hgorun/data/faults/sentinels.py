"""Numbers that loggers write where they have no value, such as -9999: told where nobody has said so."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.config.data import Column, Judged
from hgorun.data.recording import Note
from hgorun.data.samples import Samples
from hgorun.pieces import all_true, extremes

_USUAL = np.array(
    [99, 99.9, 99.99, 999, 999.9, 999.99, 999.25, 6999, 7999, 9998, 9999, 9999.9, 99999, 99999.9, 999999, 9999999,
     32767, 32768, 65535, 2147483647, 2147483648, 4294967295, 9223372036854775807, 18446744073709551615,
     3276.7, 3276.8, 6553.5, 327.67, 327.68, 655.35,  # of 16 bits, in tenths and hundredths
     1e20, 1e30, 1e31, 9.96921e36, 9.969209968386869e36, 1e37, 9.9e37, 9.91e37, 1e38, 3.4028235e38]
)  # fmt: skip
_LARGEST = 1e300  # nothing is measured beyond it
_ALIKE = 1e-6  # of it: doubles of single precision are as well
_FEWEST = 3  # other values that show where a column lies
_BELOW, _BEYOND = 0.5, 2.0  # of the span of the others: so far off a negative one beside none is, and any
_MOST = 8  # different ones of a column
_OFTEN = 0.1  # of a column: so much of what is measured may be held at a number, or be switched to its negative
_AS_LARGE = 1e-4  # of it
_RUN = 3  # values in a row, on average, of what is held
_LARGE = 50.0  # times the largest of the others: nothing is held so far off


def sentinels(values: np.ndarray) -> Iterator[tuple[float, float, float]]:
    """Numbers in the list of usual ones that lie far outside of all others, with the ends of these.

    A measured value is exactly such a number by chance, and then its neighbours are near, or it is one at which the
    column rests: a valve at 99 %, a signal of +-99. Of a column that rests at one other value a positive one may be a
    step of what is measured.
    """
    left, found = values, list[float]()
    while len(found) < _MOST and (end := _usual_end(left)) is not None:
        found.append(end)
        left = left[left != end]
    if not found:
        return
    told: dict[float, tuple[float, float]] = {}
    measured = left[~np.isnan(left)]
    for number in reversed(found):  # from within: one that is measured shows where the column lies
        if measured.size >= _FEWEST and _is_far(number, measured, values):
            told[number] = float(measured.min()), float(measured.max())
        else:
            measured = np.append(measured, np.full(np.count_nonzero(values == number), number))
    yield from ((number, *told[number]) for number in found if number in told)


def _usual_end(values: np.ndarray) -> float | None:
    """The least or the largest value if it is a usual one and is not switched to its negative and back."""
    return next(
        (end for end in extremes(values) if are_usual(np.array(end)) and not _is_half_of_two(end, values)), None
    )


def are_usual(numbers: np.ndarray) -> np.ndarray:
    """Which numbers, or their negatives, are in the list of usual ones."""
    sizes = np.abs(numbers)[..., None]
    found: np.ndarray = np.any(np.abs(sizes - _USUAL) <= _ALIKE * _USUAL, axis=-1) | (sizes[..., 0] >= _LARGEST)
    return found


def _is_half_of_two(number: float, values: np.ndarray) -> bool:
    """Whether a number and its negative, or nearly that, are often there both: -32768 and 32767, too."""
    least = max(_OFTEN * np.count_nonzero(~np.isnan(values)), _RUN)
    near = _AS_LARGE * abs(number)
    with np.errstate(over="ignore"):  # of two at either end of doubles
        return all(np.count_nonzero(np.abs(values - one) <= near) >= least for one in (number, -number))


def _is_far(number: float, others: np.ndarray, values: np.ndarray) -> bool:
    """Whether a number lies far outside of others, and is not one at which the column is held."""
    low, high = float(others.min()), float(others.max())
    off = max(low - number, number - high)
    if number < 0 <= low:
        return off > _BELOW * (high - low)
    return high > low and off > _BEYOND * (high - low) and not _is_held(number, max(-low, high), values)


def _is_held(number: float, largest: float, values: np.ndarray) -> bool:
    """Whether a column goes to a number and back, and stays at either end: no more than some times the others."""
    held = values[~np.isnan(values)] == number
    count = int(np.count_nonzero(held))
    stretches = (1 + np.count_nonzero(np.diff(held))) / 2  # of either kind
    often = count >= _OFTEN * held.size and min(count, held.size - count) >= _RUN * stretches
    return often and abs(number) <= _LARGE * largest


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
    good = np.broadcast_to(np.True_, written.shape) if samples.good is None else samples.good != 0
    plausible = block.plausible if isinstance(block, Judged) else None
    if plausible is not None:
        good = good & (samples.values >= plausible[0]) & (samples.values <= plausible[1])
    for number, low, high in sentinels(np.where(good, written, np.nan) if not all_true(good) else written):
        places = np.flatnonzero(good & (written == number))
        file, line = samples.place(int(places[0]))
        times = "1 value is" if places.size == 1 else f"{places.size:,} values are"
        shown = f"{number:.15g}" if float(f"{number:.15g}") == number else f"{number:.17g}"
        said = (
            f"{times} {shown}, far outside of the others ({low:.6g} to {high:.6g}), and taken as measured: if "
            f"that means a missing value: csv: {{missing: [{shown}]}}; csv goes below {owner}"
        )
        yield Note(kind="sentinel", signal=samples.key, file=file, line=line, count=places.size, message=said)
