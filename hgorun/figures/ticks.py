"""Ticks and their labels. This module imports matplotlib; import it where it is used."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.ticker import AutoMinorLocator, FixedLocator, LogLocator, MaxNLocator, NullFormatter, ScalarFormatter

_SHORT = 30  # logarithmic axes that span less are labelled between the powers of ten


class PlainFormatter(ScalarFormatter):
    """Tick labels as plain text: in these fonts they look the same as mathematics, which takes long to set.

    A power of ten that they share is still set as mathematics.
    """

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The label of a tick."""
        return super().__call__(x, pos).removeprefix(r"$\mathdefault{").removesuffix("}$")


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
            if 0 < low < high < _SHORT * low:  # too few powers of ten in it
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
                axis.set_major_formatter(PlainFormatter())
        else:
            axis.set_major_locator(MaxNLocator(nbins=limit or "auto", steps=[1, 2, 5, 10]))
            axis.set_minor_locator(AutoMinorLocator(2))
            axis.set_major_formatter(PlainFormatter())
