"""Ticks and their labels. This module imports matplotlib; import it where it is used."""

from __future__ import annotations

from math import ceil, floor, log10

from matplotlib.axes import Axes
from matplotlib.ticker import (
    AutoMinorLocator,
    FixedLocator,
    Locator,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    ScalarFormatter,
)

_SHORT = 30  # logarithmic axes that span less, or have one power of ten, are labelled between these
_FEWEST = 3  # labels
_CROWDED = 5.0  # where it spans more, or has a power of ten, labels at every digit would touch
_LINEAR = 2.0  # an axis that spans less is labelled as a linear one


class PlainFormatter(ScalarFormatter):
    """Tick labels as plain text: in these fonts they look the same as mathematics, which takes long to set.

    A power of ten that they share is still set as mathematics.
    """

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The label of a tick."""
        return super().__call__(x, pos).removeprefix(r"$\mathdefault{").removesuffix("}$")


def written(value: float, digits: int) -> str:
    r"""A number as an axis of numbers writes it: a large or a small one with a power of ten, set as mathematics.

    Parameters
    ----------
    value : float
    digits : int
        To which it is rounded; those before the point of a whole number are always written.

    Examples
    --------
    >>> [written(value, 2) for value in (0.025, 200.0, 1250.0, 1.5e6, 1e-5)]
    ['0.025', '200', '1250', '$1.5 \\times 10^{6}$', '$10^{-5}$']
    """
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent or 0)
    if -4 <= power < 5:
        return f"{value:.{max(digits, power + 1)}g}"
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"$10^{{{power}}}$" if mantissa == "1" else rf"${mantissa} \times 10^{{{power}}}$"


def _between(low: float, high: float, most: int) -> Locator:
    """Labels at 1, 2 and 5 times the powers of ten; where these are fewer than three, at more digits, or evenly.

    At every digit last: where a power of ten is among them, those below it stand closer than those above it. An axis
    that spans little is nearly linear.
    """
    if high < _LINEAR * low:
        return _evenly(most)
    powers = range(floor(log10(low)), ceil(log10(high)) + 1)
    crowded = high > _CROWDED * low or any(low < 10.0**power < high for power in powers)
    fewer = ((1, 2, 3, 5, 7),) if crowded else ()
    for digits in ((1, 2, 5), *fewer, tuple(range(1, 10))):
        if _FEWEST <= sum(low <= digit * 10.0**power <= high for digit in digits for power in powers) <= most:
            return LogLocator(subs=digits)
    return _evenly(most)


def _evenly(most: int) -> Locator:
    return MaxNLocator(nbins=min(most, 7), steps=[1, 2, 5, 10])


def _powers(low: float, high: float) -> int:
    return floor(log10(high)) - ceil(log10(low)) + 1


def tick(ax: Axes, limit: int | None = None) -> None:
    """Ticks at round numbers, one small one between them; on either axis at most ``limit`` of them.

    Ticks at places of their own stay.
    """
    for axis, scale in ((ax.xaxis, ax.get_xscale()), (ax.yaxis, ax.get_yscale())):
        if isinstance(axis.get_major_locator(), FixedLocator):
            continue  # whoever has set them knows which
        low, high = sorted(axis.get_view_interval())
        if scale == "log":
            axis.set_major_locator(LogLocator(numticks=limit or 6))
            axis.set_minor_formatter(NullFormatter())
            if 0 < low < high and (high < _SHORT * low or (limit is None and _powers(low, high) < 2)):
                axis.set_major_locator(_between(low, high, limit or 8))
                axis.set_major_formatter(PlainFormatter())
        else:
            axis.set_major_locator(MaxNLocator(nbins=limit or "auto", steps=[1, 2, 5, 10]))
            axis.set_minor_locator(AutoMinorLocator(2))
            axis.set_major_formatter(PlainFormatter())
