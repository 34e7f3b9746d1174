"""Where the right-hand side is not smooth: kinks of functions of time, and what delays make of them.

A step of a Runge-Kutta method keeps its order only if everything is smooth inside it. Functions of time
have kinks or jumps where the argument of abs, sign, min, max, floor or a comparison crosses a value; a
continuous delay repeats every event, one derivative smoother each time, at the times t with t - d(t) = event.
Both are found for certain, however close to each other they are; what cannot be followed is told.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from hgorun.config.expressions import parse
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.memo import Memo
from hgorun.pieces import distinct
from hgorun.symbolic.clock import on_the_clock
from hgorun.symbolic.crossings import Found, Search, TooMany
from hgorun.symbolic.evaluate import Floats, evaluate
from hgorun.symbolic.kinks import Kink, Pieces
from hgorun.symbolic.levels import Levels, listed

LEVELS = 4  # repetitions of an event that a fourth-order method can see
_INSIDE = 0.382  # where a piece is looked at: not in the middle, where a symmetric function may touch a level
_MARGIN = 4  # doubles beside a kink at which a function is looked at
_NEAR = 10.0 ** -np.arange(3, 13)  # how near to a pole a function is looked at, in parts of the piece
_FAR = np.array([0.1, 0.5])
_POLE = 1e6  # times larger near a pole than far from it


@dataclass(frozen=True, eq=False, repr=False)
class Irregular:
    """What is not smooth in a span of time.

    Attributes
    ----------
    times : ndarray
        Kinks, jumps and poles, in ascending order.
    lost : tuple of (float, float)
        Where there may be more of them.
    infinite : float or None
        The first time at which a value is not a finite number, or beyond all bounds.
    """

    times: Floats
    lost: tuple[tuple[float, float], ...] = ()
    infinite: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Kinks:
    """Kinks and jumps of expressions at times that depend on t and p alone, not on a state.

    Attributes
    ----------
    pieces : Pieces
    parts : casadi.Function, optional
        Of (t, p): what the kinks are the extremes of, and its slopes.
    """

    pieces: Pieces
    parts: ca.Function | None = None

    @classmethod
    def of(cls, expressions: Iterable[ca.SX], t: ca.SX, p: ca.SX) -> Kinks:
        """Look for them in expressions."""
        return cls(Pieces.of(expressions, t, p))

    @classmethod
    def of_slopes(cls, expressions: Iterable[ca.SX], t: ca.SX, p: ca.SX) -> Kinks:
        """The extremes of expressions, or of those that depend on other symbols the extremes of parts that do not."""
        parts = Pieces.of(expressions, t, p).watched(t, p)
        each = [(part, ca.jacobian(part, t)) for part in ca.vertsplit(parts)] if parts.numel() else []
        each = [(part, slope) for part, slope in each if not slope.is_zero()]
        values, slopes = (
            ca.vertcat(ca.SX(0, 1), *column) for column in (zip(*each, strict=True) if each else ([], []))
        )
        function = ca.Function("parts", [t, p], [ca.densify(values), ca.densify(slopes)])
        return cls(Pieces.of([ca.SX(0), *(ca.sign(slope) for _, slope in each)], t, p), function)

    def between(self, values: Floats, start: float, end: float, limit: float = np.inf) -> Irregular:
        """The kinks for given values of p, from start to end.

        Raises
        ------
        TooMany
            Where there are more of them than ``limit``.
        """
        pieces, span = self.pieces, _Span(self.pieces, values, start, end, limit)
        key = self, values[pieces.deciding].tobytes(), start, end, limit
        places = _PLACES.get(key, lambda: span.places(span.crossings()))
        return _FOUND.get((*key, values[pieces.shown].tobytes()), lambda: span.irregular(places))


_PLACES: Memo[_Places] = Memo(32)
_FOUND: Memo[Irregular] = Memo(32)


def infinite(when: float) -> str:
    """What is said of a function of time that has no finite value at some time."""
    near = when if abs(when) >= np.finfo(float).tiny else 0.0  # the smallest numbers behind a pole at 0
    return f"this is not finite at t = {near:.12g}: it has a pole or no real value there"


def not_followed(what: str, lost: tuple[tuple[float, float], ...], origin: float) -> str:
    """What is said of a function of time whose kinks may not all have been found."""
    first, last = origin + min(a for a, _ in lost), origin + max(b for _, b in lost)
    return (
        f"{what}: kinks or jumps between t = {first:.6g} and t = {last:.6g} may have been missed, "
        "where the sign of an argument cannot be told from rounding"
    )


def too_many(error: TooMany, what: str, memory: float) -> str:
    """What is said of functions of time with too many kinks."""
    (count,) = error.args
    return (
        f"{what} have at least {count:.4g} kinks and jumps in this run, about "
        f"{count * EVENT_BYTES / 2**30:.3g} GiB; time.max_memory allows {memory / 2**30:.3g} GiB"
    )


@dataclass(frozen=True, eq=False, repr=False)
class _Places:
    """What the crossings of a span say, whatever the values are.

    Attributes
    ----------
    times, poles : ndarray
        Of all crossings, and of those where a value may have none.
    lost : tuple of (float, float)
        Where there may be more of them.
    edges, watched : ndarray
        The ends of the pieces, and the times at which values are looked at.
    """

    times: Floats
    poles: Floats
    lost: tuple[tuple[float, float], ...]
    edges: Floats
    watched: Floats


@dataclass(frozen=True, eq=False, repr=False)
class _Span:
    """Expressions in pieces, in a span of time."""

    pieces: Pieces
    p: Floats
    start: float
    end: float
    limit: float

    def crossings(self, last: Levels | None = None) -> list[Found]:
        """Of every kink when its argument crosses a level; ``last``: other levels for the outermost."""
        kinks = list(self.pieces.kinks)
        if last is not None:
            kinks[-1] = replace(kinks[-1], levels=last)
        found: list[Found] = []
        for kink in kinks:
            found.append(self._crossings(kink, _union(found[k] for k in kink.inside)))
        return found

    def places(self, crossings: list[Found]) -> _Places:
        """Where to look, from what :meth:`crossings` has found."""
        times = _union(crossings)
        lost = tuple(sorted({span for found in crossings for span in found.lost}))
        poles = _union(found for found, kink in zip(crossings, self.pieces.kinks, strict=True) if kink.singular)
        edges = self._edges(times)
        margin = _MARGIN * np.spacing(np.maximum(np.abs(edges), 1e-12 * (self.end - self.start)))
        low, high = edges[:-1] + margin[:-1], edges[1:] - margin[1:]
        watched = np.column_stack([low, 0.5 * (low + high), high])[high > low].ravel()
        return _Places(times, self._edges(poles)[1:-1], lost, edges, watched)

    def irregular(self, places: _Places) -> Irregular:
        """All that is irregular."""
        return Irregular(places.times, places.lost, self._infinite(places))

    def _edges(self, times: Floats) -> Floats:
        inner = times[(times > self.start) & (times < self.end)]
        return np.concatenate([[self.start], inner, [self.end]])

    def _crossings(self, kink: Kink, inside: Floats) -> Found:
        """``inside``: the times of the kinks that its argument has itself."""
        edges = self._edges(inside)
        low, high = edges[:-1], edges[1:]
        states = np.zeros((low.size, 0))
        if kink.held:
            states = evaluate(self.pieces.states, (low + _INSIDE * (high - low))[:, None], self.p)[0][:, kink.held]
        search = Search(kink.argument, self.p, states, kink.levels, kink.touches, self.limit)
        return search.between(low, high)

    def _infinite(self, places: _Places) -> float | None:
        """The first time at which a watched value is not finite, or grows beyond all bounds near one of the poles."""
        if not self.pieces.watched.numel_out(0):
            return None
        bad = places.watched[~np.isfinite(self._watched(places.watched)).all(axis=1)]
        found = [float(bad[0])] if bad.size else []
        return min([*found, *self._poles(places.poles, places.edges)], default=None)

    def _poles(self, candidates: Floats, edges: Floats) -> list[float]:
        """Those of the candidates near which a watched value is much larger than elsewhere on its piece."""
        found = []
        for pole in candidates:
            after = int(np.searchsorted(edges, pole, side="right"))
            for other in (edges[after - 2], edges[min(after, edges.size - 1)]):
                reach = other - pole
                near = np.append(reach * _NEAR, np.copysign(_MARGIN * np.spacing(max(abs(pole), abs(reach))), reach))
                size = np.abs(self._watched(pole + np.concatenate([near, reach * _FAR])))
                far = size[near.size :].max(axis=0)
                if np.any(size[: near.size].max(axis=0) > _POLE * np.maximum(far, np.finfo(float).tiny)):
                    found.append(float(pole))
                    break
        return found

    def _watched(self, times: Floats) -> Floats:
        with np.errstate(all="ignore"):
            return evaluate(self.pieces.watched, times[:, None], self.p)[0]


def _union(found: Iterable[Found]) -> Floats:
    return distinct(np.concatenate([np.zeros(0), *(one.times for one in found)]))


def repeated(events: Floats, delay: str, start: float, end: float, origin: float = 0.0) -> Irregular:
    """The times t in (start, end] with t - d(t) = an event; ``delay`` is d as text, of the time origin + t."""
    expression = parse(delay, names=("t",))
    if not expression.names:
        times = events + expression.number()
        return Irregular(times[(times > start) & (times <= end)])
    pieces, nothing = _late(delay, origin), np.zeros(0)
    if not pieces.kinks:  # a delay of t + c: what is heard is always of one time
        return Irregular(nothing)
    span = _Span(pieces, nothing, start, end, np.inf)
    crossings = span.crossings(listed(distinct(events), reached=False))
    times = crossings[-1].times
    return Irregular(times[times > start], span.places(crossings).lost)


@lru_cache(maxsize=64)
def _late(delay: str, origin: float) -> Pieces:
    """t - d(t) in pieces, as the argument of the last kink."""
    t = ca.SX.sym("t")
    value = parse(delay, names=("t",)).symbol({"t": on_the_clock(t, origin)})
    return Pieces.of([ca.floor(t - value)], t, ca.SX(0, 1))


def merge(times: Floats, tolerance: float) -> Floats:
    """Sorted times, those closer than ``tolerance`` to their predecessor dropped."""
    times = distinct(times)
    if times.size < 2:
        return times
    groups = np.concatenate([[True], np.diff(times) > tolerance])
    return np.asarray(times[groups])
