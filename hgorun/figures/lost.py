"""What figures show of members, and of those whose estimates are lost: these count as infinite."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Floats
from hgorun.ensemble.statistics.statistics import QUANTILES, quantiles
from hgorun.figures.style import ENDLESS, LARGEST_NUMBER, edged

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hgorun.figures.looks import Look

_WIDE, _NARROW = 0.13, 0.22  # how dark bands are: from q05 to q95, from q25 to q75
_FAR = 1e3  # in units of the largest number that a panel has: beyond it
_HIGHEST, _APART, _ROWS = 0.96, 0.055, 8  # of crosses, in parts of a panel's height


def spread(values: Floats, sound: NDArray[np.bool_], *, signed: bool = False) -> Floats:
    """The quantiles of members.

    Parameters
    ----------
    values : ndarray, shape (N, ...)
    sound : ndarray of bool, shape (N, ...)
        What is not lost.
    signed : bool
        Whether values have two signs, as estimates have and sizes of errors have not. What is lost then is neither
        above nor below the rest: the lower quantiles count it as minus infinity, the upper ones as infinity.

    Returns
    -------
    ndarray, shape (5, ...)
        As in :data:`QUANTILES`; infinite where so many are lost, NaN without members. The median is infinite where at
        least half are lost; with signs it is elsewhere that of the others.
    """
    sound = sound & (np.abs(values) <= LARGEST_NUMBER)
    rows = np.array(quantiles(values, sound, QUANTILES.values()), dtype=float)
    some = ~sound.all(axis=0)
    if signed and some.any():
        rows[0], rows[1] = (-one for one in quantiles(-values, sound, (0.95, 0.75)))
        some &= np.isfinite(rows[2])
        ordered = np.sort(np.where(sound, values, np.inf)[:, some], axis=0)
        count = sound[:, some].sum(axis=0)
        middle = [np.take_along_axis(ordered, k[None], axis=0)[0] for k in ((count - 1) // 2, count // 2)]
        rows[2, some] = (middle[0] + middle[1]) / 2
    return rows


def largest_of(several: Iterable[Floats]) -> float:
    """The size of the largest finite number of several arrays; 0 of none."""
    return max((float(np.max(np.abs(one), where=np.isfinite(one), initial=0.0)) for one in several), default=0.0)


def ends(rows: Floats, largest: float) -> Floats:
    """Quantiles, of which those that are infinite are far beyond the panel.

    Parameters
    ----------
    rows : ndarray
    largest : float
        The size of the largest number in the panel, of whichever observer: see :func:`largest_of`.
    """
    return np.where(np.isinf(rows), np.copysign(_FAR * (largest or 1.0), rows), rows)


def bands(rows: Floats, largest: float) -> Iterator[tuple[Floats, Floats, float]]:
    """The lower and the upper end of each band, and how dark it is; parameters as of :func:`ends`.

    Where both ends are infinite a band has left the panel, and is drawn no more.
    """
    known, drawn = np.isfinite(rows), ends(rows, largest)
    for low, high, opacity in ((0, 4, _WIDE), (1, 3, _NARROW)):
        left = ~known[low] & ~known[high]
        left &= np.isposinf(rows[low]) | np.concatenate([[True], left[:-1]])
        yield np.where(left, np.nan, drawn[low]), np.where(left, np.nan, drawn[high]), opacity


def drawn_median(rows: Floats) -> Floats:
    """The median where it is finite."""
    return np.where(np.isfinite(rows[2]), rows[2], np.nan)


def mostly_lost(rows: Floats) -> NDArray[np.bool_]:
    """Where at least half of the members are lost."""
    return np.asarray(np.isposinf(rows[2]))


def first_lost(rows: Floats) -> NDArray[np.bool_]:
    """Of :func:`mostly_lost` along time the beginnings."""
    lost = mostly_lost(rows)
    before = np.zeros_like(lost)
    before[1:] = lost[:-1]
    return lost & ~before


def height_of_crosses(order: int) -> float:
    """Where an observer's crosses are, in parts of a panel's height: those of several stand below each other."""
    return _HIGHEST - _APART * (order % _ROWS)


def within_sound(values: Floats, rows: Floats) -> Floats:
    """What the limits of an axis follow from: medians and 90 %, but nothing beyond members that are never lost.

    Parameters
    ----------
    values : ndarray, shape (N, Nt)
    rows : ndarray, shape (5, Nt)
        Of these values.
    """
    sound = values[(np.abs(values) <= LARGEST_NUMBER).all(axis=1)]
    shown = rows[[0, 2, 4]]
    shown = shown[np.isfinite(shown)]
    return np.clip(shown, sound.min(), sound.max()) if sound.size else shown


def draw_bands(ax: Axes, at: Floats, rows: Floats, look: Look, largest: float) -> None:
    """Both bands of an observer; ``largest`` as of :func:`ends`."""
    for low, high, opacity in bands(rows, largest):
        gid = ENDLESS if np.nanmax(np.abs([low, high]), initial=0.0) > largest else None
        ax.fill_between(at, low, high, gid=gid, **edged(look.colour, opacity))


def draw_crosses(ax: Axes, at: Floats, look: Look, order: int) -> None:
    """Crosses at the upper edge of a panel."""
    if not len(at):
        return
    height = np.full(len(at), height_of_crosses(order))
    ax.plot(at, height, color=look.colour, linestyle="none", marker="x", markersize=5, markeredgewidth=1.3, label="_",
            zorder=4, clip_on=False, in_layout=False, transform=ax.get_xaxis_transform())  # fmt: skip


def say_above(ax: Axes, text: str) -> None:
    """Say how many are lost, above the right end of a panel."""
    ax.text(1.0, 1.01, text, fontsize=7, ha="right", va="bottom", transform=ax.transAxes)


def lost_or_unsettled(*, lost: bool, unsettled: bool) -> str:
    """What members do of which a place has no number, or half of them has none; empty where there are none."""
    return " or ".join(["are lost"] * lost + ["never settle"] * unsettled)


def words_of_lost(
    sound: NDArray[np.bool_],
    groups: Iterable[NDArray[np.bool_]],
    *,
    along: bool = False,
    as_lines: bool = False,
    unsettled: int = 0,
) -> str:
    """What is said of members that are lost, or never settle; nothing where there are none.

    Parameters
    ----------
    sound : ndarray of bool, shape (N, m)
        Of every member and observer.
    groups : iterable of ndarray of bool, shape (K,) or (K, Nt)
        Those whose quantiles are drawn.
    along : bool
        Whether they are drawn along time, estimates among them.
    as_lines : bool
        Whether members have lines and not bands.
    unsettled : int
        How many members never settle; their times are not sound in the groups.
    """
    lost = int(np.sum(~sound.all(axis=1)))
    if not lost and not unsettled:
        return ""
    rows = [spread(np.zeros(group.shape), group) for group in groups]
    leaving = any(np.any(np.isfinite(one[[0, 1]]) & np.isposinf(one[[4, 3]])) for one in rows)
    said = [f"estimates are lost in {lost} of {len(sound)} members and count as infinite"] * bool(lost)
    said = [words + ", but not in medians of states" * along for words in said]
    said += [f"estimates never settle in {unsettled} of {len(sound)} members; their times count as infinite"] * bool(
        unsettled
    )
    half = lost_or_unsettled(lost=bool(lost), unsettled=bool(unsettled))
    said += ["their lines end"] if as_lines else ["bands leave the panel there"] * leaving
    said += [f"×: half or more {half}" + " from then on" * along] * any(np.any(mostly_lost(one)) for one in rows)
    return "; " + "; ".join(said)
