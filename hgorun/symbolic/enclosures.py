"""Where the values of a function of a vector lie on boxes, and the largest of them: by interval arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.memo import Memo
from hgorun.native.boxes import LEAST
from hgorun.symbolic.evaluate import evaluate
from hgorun.symbolic.instructions import Instruction, read
from hgorun.symbolic.interval_operations import Bounds
from hgorun.symbolic.intervals import enclose
from hgorun.symbolic.segment_means import Form, SegmentMeans, can_be_compiled

_SLICES, _NARROWINGS = 256, 9  # to the last bit of 64
_NEAR = 0.01  # of a box: how far a point without a bound may be from that of other constants
_POLES: Memo[np.ndarray | None] = Memo(128)  # the last one found, by form


@dataclass(frozen=True, eq=False, repr=False)
class Enclosure:
    """A function of a vector, evaluated on boxes.

    Parameters
    ----------
    function : casadi.Function
        One vector in, one dense column of numbers out, made of SX.
    """

    function: ca.Function
    _forms: dict[tuple[int, int], Form] = field(default_factory=dict)  # by ends and parts
    _compiled: dict[tuple[int, int], SegmentMeans] = field(default_factory=dict)
    _poles: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)  # corners of boxes that hold one each

    def has_pole(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Whether a box, corners (d,), is known to hold a point without a bound: then no cutting of it leads to one.

        Where nothing is known yet, what is near the pole of a function that differs in its constants only is tried.
        """
        if not self._poles and (beside := _POLES.get(self._form(0, 1).digest, lambda: None)) is not None:
            reach = _NEAR * (high - low)
            below, above = np.maximum(beside - reach, low), np.minimum(beside + reach, high)
            if np.all(below <= above) and not np.isfinite(self(below[None], above[None])).all():
                self.find_pole(below, above)
        return any(np.all(low <= below) and np.all(above <= high) for below, above in self._poles)

    def find_pole(self, low: np.ndarray, high: np.ndarray) -> None:
        """Narrow a box of which nothing is known down to neighbouring numbers, and keep these where it is so there."""
        low, high = low.copy(), high.copy()
        for j in np.tile(np.flatnonzero(self.matters), _NARROWINGS):
            if low[j] == high[j]:
                continue
            edges = np.linspace(low[j], high[j], _SLICES + 1)
            middles = 0.5 * (edges[:-1] + edges[1:])  # most poles are met with one number given
            lows, highs = np.tile(low, (2 * _SLICES, 1)), np.tile(high, (2 * _SLICES, 1))
            lows[:, j], highs[:, j] = np.append(edges[:-1], middles), np.append(edges[1:], middles)
            unbounded = np.flatnonzero(~np.isfinite(np.maximum(*map(np.abs, self(lows, highs)))))
            if not unbounded.size:
                return
            given = unbounded[unbounded >= _SLICES]
            k = given[given.size // 2] if given.size else unbounded[unbounded.size // 2]
            low, high = lows[k], highs[k]
        self._poles.append((low, high))
        _POLES.put(self._form(0, 1).digest, 0.5 * (low + high))

    @cached_property
    def instructions(self) -> list[Instruction]:
        """Read once for all boxes."""
        return read(self.function)

    @cached_property
    def matters(self) -> np.ndarray:
        """Whether the values depend on an entry of the vector, shape (d,)."""
        found = np.zeros(self.function.numel_in(0), dtype=bool)
        found[list(self.function.jac_sparsity(0, 0).get_col())] = True
        return found

    def compile(self, ends: int = 0, parts: int = 1) -> bool:
        """Have :meth:`each` take a compiled loop, which gives the same bits; whether there was something to compile.

        Parameters
        ----------
        ends, parts : int
            What :meth:`compiled` is asked for later.
        """
        if (ends, parts) in self._compiled or not can_be_compiled(self.instructions):
            return False
        self._compiled[ends, parts] = SegmentMeans(self._form(ends, parts))
        return True

    def compiled(self, ends: int = 0, parts: int = 1) -> SegmentMeans | None:
        """The compiled loop over so many parts of segments along which the first entries change, of those of a box.

        There is one where it has been compiled, also for a function that differs from this one in its constants only.
        """
        if (ends, parts) not in self._compiled and self._form(ends, parts).compiled:
            self.compile(ends, parts)
        return self._compiled.get((ends, parts))

    def _form(self, ends: int, parts: int) -> Form:
        found = self._forms.get((ends, parts))
        if found is None:
            count, values = self.function.numel_in(0), self.function.numel_out(0)
            found = self._forms[ends, parts] = Form(self.instructions, ends, count - ends, values, parts)
        return found

    def each(self, low: np.ndarray, high: np.ndarray) -> Bounds:
        """Bounds (M, m) of the m values on M boxes with corners low and high, shapes (M, d)."""
        compiled = self.compiled()
        if compiled is not None:
            count = len(low)
            rows = np.hstack([low, high])[np.minimum(np.arange(max(count, LEAST)), count - 1)]
            below, above = compiled(rows.T)
            return below[:count], above[:count]
        found = self.columns(list(zip(low.T, high.T, strict=True)))
        sides = tuple(np.zeros((low.shape[0], len(found))) for _ in range(2))
        for column, bounds in enumerate(found):
            for side, value in zip(sides, bounds, strict=True):
                side[:, column] = value
        return sides[0], sides[1]

    def columns(self, box: Sequence[Bounds]) -> list[Bounds]:
        """Bounds of the m values, each of the shape that those of the vector's entries have together."""
        (found,) = enclose(self.function, lambda _, column: box[column], instructions=self.instructions)
        return found

    def __call__(self, low: np.ndarray, high: np.ndarray) -> Bounds:
        """Bounds (M,) of the only value."""
        smallest, largest = self.each(low, high)
        return smallest[:, 0], largest[:, 0]

    def at(self, points: np.ndarray) -> np.ndarray:
        """The values (M,) at M points (M, d)."""
        return evaluate(self.function, points)[0].ravel()


@dataclass(frozen=True, eq=False, repr=False)
class Extent:
    """The largest modulus of a function on a box: it lies between ``reached`` and ``bound``."""

    bound: float
    reached: float


def largest(enclosure: Enclosure, low: np.ndarray, high: np.ndarray, *, limit: int = 4096, gap: float = 0.01) -> Extent:
    """Enclose the largest modulus of a function on a box by cutting the box into ever smaller ones.

    Parameters
    ----------
    enclosure : Enclosure
        Of a function of a vector (d,) with one value.
    low, high : ndarray, shape (d,)
    limit : int
        Boxes looked at, together, at most.
    gap : float
        Good enough: bound <= (1 + gap) reached.
    """
    if enclosure.has_pole(low, high):
        return Extent(np.inf, 0.0)
    lows, highs = low[None, :].astype(float), high[None, :].astype(float)
    closed = reached = 0.0
    for turn in range(60):
        inner, outer = enclosure(lows, highs)
        bounds = np.maximum(np.abs(inner), np.abs(outer))
        middles = enclosure.at(0.5 * (lows + highs))
        reached = max(reached, float(np.max(np.abs(middles), initial=0.0, where=np.isfinite(middles))))
        open_ = bounds > (1 + gap) * reached
        closed = max(closed, float(np.max(bounds[~open_], initial=0.0)))
        widths = np.where(enclosure.matters, highs - lows, 0.0)
        if not open_.any() or 2 * open_.sum() > limit or not np.any(widths[open_] > 0):
            bound = max(closed, float(np.max(bounds[open_], initial=0.0)))
            if np.isinf(bound):
                off = np.max(np.abs(lows + highs - low - high) / np.where(high > low, high - low, 1.0), axis=1)
                k = int(
                    np.argmin(np.where(np.isinf(bounds), off, np.inf))
                )  # in the middle, so that other boxes have it
                enclosure.find_pole(lows[k], highs[k])
            return Extent(bound, reached)
        lows, highs, widths = lows[open_], highs[open_], widths[open_]
        # every direction in turn, so that none is left out for being short
        order = np.flatnonzero(np.any(widths > 0, axis=0))
        j = order[turn % order.size]
        middle = 0.5 * (lows[:, j] + highs[:, j])
        left, right = highs.copy(), lows.copy()
        left[:, j], right[:, j] = middle, middle
        lows, highs = np.vstack([lows, right]), np.vstack([left, highs])
    inner, outer = enclosure(lows, highs)
    return Extent(max(closed, float(np.max(np.maximum(np.abs(inner), np.abs(outer)), initial=0.0))), reached)
