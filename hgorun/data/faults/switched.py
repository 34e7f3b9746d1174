"""Signals that go between two levels again and again, as a flow that is turned on and off: no slip of a unit."""

from __future__ import annotations

import numpy as np

from hgorun.pieces import quantiles

_STEPS = 3  # there, back and there again: a unit slips once, and perhaps back
_DRIFT = 3.0  # times the usual change between neighbours: what rests at a level moves less, also one with noise
_WIDE = float(np.log(1.5))  # a level is narrower, whatever its noise
_ALIKE = 4.0  # times: so much more may one side move than the other where the unit alone has changed


def is_switched(levels: np.ndarray, slip: int, steps: np.ndarray, *, wide: float = _WIDE) -> bool:
    """Whether a signal goes between two levels, and a step from one to the other is nothing but that.

    It steps back and forth, and rests at one of the levels at least: what moves on meanwhile, in either unit alike, is
    one whose unit slips again and again. Or it steps twice in one direction: it has gone back on its own.

    Parameters
    ----------
    levels : ndarray, shape (n,)
        The values in which a slip is a step of one height: logarithms of their sizes for a factor.
    slip : int
        The first sample behind a step that may be a slip.
    steps : ndarray of integers
        Those behind all large steps.
    wide : float
        What is no level.
    """
    ends = np.sort(levels[slip - 1 : slip + 1])
    found = np.stack([levels[steps - 1], levels[steps]])
    alike = np.abs(np.sort(found, axis=0) - ends[:, None]).max(axis=0) < 2 * wide
    rises = np.diff(found[:, alike], axis=0)[0] > 0
    if np.any(rises[1:] == rises[:-1]):
        return True
    if rises.size < _STEPS:
        return False
    upper = levels > ends.mean()
    moved = [_moved(levels, side, wide) for side in (upper, ~upper)]
    return min(moved) * _ALIKE <= max(moved)


def _moved(levels: np.ndarray, side: np.ndarray, wide: float) -> float:
    """How far a signal moves on one side of its steps; 0 where it rests."""
    low, high = quantiles(levels[side], np.array([0.1, 0.9])).tolist()
    usual = float(np.abs(np.diff(levels)[side[1:] & side[:-1]]).mean())
    moved: float = high - low
    return moved if moved > min(wide, _DRIFT * usual) else 0.0
