"""What may be narrow in a state: where it is, along a trajectory that is known between the steps.

A force that acts within 1e-4 of a position, or a peak exp(-(x/1e-4)^2), lasts as long as the state takes to pass it,
which may be less than a step. Comparisons, signs and the like have such features where their arguments cross a value,
exponentials and quotients where their arguments have an extreme. Along a trajectory that is a cubic between neighbouring
times these are functions of time, whose crossings and extremes are found as those of inputs are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.symbolic.crossings import Search, Smooth
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.instructions import read
from hgorun.symbolic.intervals import Bounds
from hgorun.symbolic.kinks import STEPS, apply_to, levels_of
from hgorun.symbolic.levels import Levels, distinct, zero

_SWITCHES = STEPS - {ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR} | {ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX}
_RAMPS = {ca.OP_TANH, ca.OP_ATAN}
_EXPONENTIALS = {ca.OP_EXP, ca.OP_EXPM1, ca.OP_COSH, ca.OP_SINH}
_QUOTIENTS = {ca.OP_DIV, ca.OP_INV}
_POWERS = {ca.OP_POW, ca.OP_CONSTPOW}
_HIGH_POWER = 16.0
_CHANGE = 1.0  # of an argument, or of the logarithm of a divisor: less makes nothing narrow
_ZERO = zero(reached=False)


@dataclass(frozen=True, eq=False)
class Curve:
    """A trajectory: a cubic on every cell of time.

    Attributes
    ----------
    low, high : ndarray, shape (cells,)
    coefficients : ndarray, shape (cells, states, 4)
        Of 1, r, r^2 and r^3, where r goes from 0 to 1 on each cell.
    """

    low: Floats
    high: Floats
    coefficients: Floats

    @classmethod
    def through(cls, low: Floats, high: Floats, values: Floats) -> Curve:
        """From the states at the start, at a third, at two thirds and at the end of every cell, (cells, 4, states)."""
        whole = np.all(np.isfinite(values), axis=(1, 2)) & (high > low)
        thirds = np.array([[0.0, 0.0, 0.0], [1, 1, 1], [2, 4, 8], [3, 9, 27]]) / np.array([3, 9, 27])
        inverse = np.linalg.inv(np.column_stack([np.ones(4), thirds]))
        return cls(low[whole], high[whole], np.einsum("kj,cjs->csk", inverse, values[whole]))


@dataclass(frozen=True, eq=False)
class Feature:
    """A place in the space of states where equations change quickly.

    Attributes
    ----------
    argument : Smooth
        What decides it, as a function of time on a cell: s are the cell's start, 1 over its length, and the
        coefficients of the states.
    slope : Smooth or None
        Of what has a peak: the slope of the argument.
    levels : Levels or None
        Of what switches: the values that the argument crosses.
    states : tuple of int
        On which it depends.
    ratio : bool
        Whether the argument counts by its logarithm.
    ramp : bool
        Whether it switches smoothly.
    """

    argument: Smooth
    slope: Smooth | None
    levels: Levels | None
    states: tuple[int, ...]
    ratio: bool = False
    ramp: bool = False

    def found(self, curve: Curve, p: Floats) -> Floats:
        """When a curve passes it, in ascending order."""
        s = self._cells(curve)
        value, _ = self.argument.bounds(curve.low, curve.high, p, s)
        some = np.ones(curve.low.size, dtype=bool) if self.levels is None else self.levels.inside(value)
        if self.levels is None or self.ramp:
            some &= self._changes(value)
        some = np.flatnonzero(some)
        if not some.size:
            return np.zeros(0)
        search = Search(self.slope or self.argument, p, s[some], self.levels or _ZERO)
        return search.between(curve.low[some], curve.high[some]).times

    def differs(self, curve: Curve, p: Floats, times: Floats, others: Floats) -> np.ndarray:
        """Whether the argument at some times is far from what it is at others, each on the cell of the first."""
        cell = np.clip(np.searchsorted(curve.low, times, side="right") - 1, 0, None)
        s = self._cells(curve)[cell]
        a, b = self.argument.at(times, p, s), self.argument.at(others, p, s)
        with np.errstate(all="ignore"):
            gap = np.log(np.abs(a / b)) if self.ratio else a - b
        return ~(np.abs(gap) <= _CHANGE)

    def _changes(self, value: Bounds) -> np.ndarray:
        """Whether an argument within such bounds may change much."""
        if not self.ratio:
            return ~(value[1] - value[0] <= _CHANGE)
        with np.errstate(all="ignore"):
            return ~((value[0] > 0) & (value[1] <= np.exp(_CHANGE) * value[0])) & ~(
                (value[1] < 0) & (value[0] >= np.exp(_CHANGE) * value[1])
            )

    def _cells(self, curve: Curve) -> Floats:
        own = curve.coefficients[:, list(self.states)].reshape(curve.low.size, -1)
        return np.column_stack([curve.low, 1 / (curve.high - curve.low), own])


def features_of(functions: Sequence[ca.Function], states: Sequence[int]) -> tuple[Feature, ...]:
    """The features of functions of (t, p, z, w) in given states; those that need w or other states are left out."""
    t, p, z = ca.SX.sym("t"), ca.SX.sym("p", functions[0].size1_in(1)), ca.SX.sym("z", functions[0].size1_in(2))
    known: dict[tuple[str, str], Feature] = {}
    for function in functions:
        for op, parts in _operations(function, t, p, z):
            for kind, argument, levels in _narrow(op, parts):
                argument = ca.cse(argument)
                key = kind, str(argument)
                within = _within(argument, z, states)
                if within and key not in known and not ca.depends_on(argument, ca.SX.sym("w")):
                    known[key] = _feature(kind, argument, levels, within, (t, p, z))
    return tuple(known.values())


def _operations(function: ca.Function, t: ca.SX, p: ca.SX, z: ca.SX) -> Iterator[tuple[int, list[ca.SX]]]:
    """The operations that may be narrow, with what they are done with; those that need w are left out."""
    looked_for = _SWITCHES | _RAMPS | _EXPONENTIALS | _QUOTIENTS | _POWERS
    nodes: dict[int, ca.SX | None] = {}
    for i in read(function):
        if i.op == ca.OP_OUTPUT:
            continue
        if i.op == ca.OP_INPUT:
            own = (t, p, z, None)[i.place[0]]
            nodes[i.value] = None if own is None else own[i.place[1]]
        elif i.op == ca.OP_CONST:
            nodes[i.value] = ca.SX(i.number)
        else:
            parts = [nodes[a] for a in i.arguments]
            given = [part for part in parts if part is not None]
            nodes[i.value] = apply_to(i.op, given) if len(given) == len(parts) else None
            if i.op in looked_for and len(given) == len(parts):
                yield i.op, given
            elif i.op in _QUOTIENTS and given and parts[-1] is not None:
                yield ca.OP_INV, given[-1:]


def _narrow(op: int, parts: list[ca.SX]) -> Iterator[tuple[str, ca.SX, Levels | None]]:
    """The kind of an operation, its argument, and the levels that this crosses."""
    if op in _SWITCHES:
        for argument, levels, *_ in levels_of(op, parts):
            yield "switch", argument, levels
    elif op in _RAMPS:
        yield "ramp", parts[0], _ZERO
    elif op in _EXPONENTIALS:
        yield "peak", parts[0], None
    elif op in _QUOTIENTS:
        yield "ratio", parts[-1], None
    elif parts[-1].is_constant() and (float(parts[-1]) < 0 or float(parts[-1]) >= _HIGH_POWER):
        yield "ratio", parts[0] ** np.ceil(abs(float(parts[-1]))), None


def _within(argument: ca.SX, z: ca.SX, states: Sequence[int]) -> tuple[int, ...]:
    """The states on which an argument depends; none where others are among them."""
    own = {e.element_hash() for e in ca.symvar(argument)}
    used = tuple(k for k in range(z.numel()) if z[k].element_hash() in own)
    return used if set(used) <= set(states) else ()


def _feature(
    kind: str, argument: ca.SX, levels: Levels | None, states: tuple[int, ...], symbols: tuple[ca.SX, ca.SX, ca.SX]
) -> Feature:
    t, p, z = symbols
    s = ca.SX.sym("s", 2 + 4 * len(states))
    r = (t - s[0]) * s[1]
    curves = [s[j] + r * (s[j + 1] + r * (s[j + 2] + r * s[j + 3])) for j in range(2, s.numel(), 4)]
    along = ca.substitute(argument, z[list(states)], ca.vertcat(*curves))
    slope = None if levels is not None else Smooth.of(ca.jacobian(along, t), t, p, s)
    return Feature(Smooth.of(along, t, p, s), slope, levels, states, ratio=kind == "ratio", ramp=kind == "ramp")


def unseen(features: Sequence[Feature], curve: Curve, p: Floats, seen: Floats, longest: float) -> Floats:
    """When a curve passes features between the times at which the equations were evaluated.

    Parameters
    ----------
    features : sequence of Feature
        Of one block of states, whose switches are looked at together.
    seen : ndarray
        The times of evaluation, in ascending order.
    longest : float
        Pieces of time between two switches that are longer are not narrow.

    Returns
    -------
    ndarray
        In ascending order.
    """
    switches, missed = [np.zeros(0)], [np.zeros(0)]
    for feature in features:
        times = feature.found(curve, p)
        if feature.levels is not None:
            switches.append(times)
        elif times.size:
            after = np.clip(np.searchsorted(seen, times), 1, seen.size - 1)
            alone = np.all([feature.differs(curve, p, times, seen[k]) for k in (after - 1, after)], axis=0)
            missed.append(times[alone])
    times = distinct(np.concatenate(switches))
    short = np.diff(times) < longest
    empty = np.searchsorted(seen, times[:-1], side="left") == np.searchsorted(seen, times[1:], side="right")
    narrow = short & empty
    return distinct(np.concatenate([times[:-1][narrow], times[1:][narrow], *missed]))
