"""Tables of many events of a live run that are carried out in one native call."""

from __future__ import annotations

import math

import numpy as np

from hgorun.engine.plan import Floats, Integers

_ROUNDING = 1 - 1e-9


def steps_of(gap: float, longest: float) -> int:
    """How many equal steps a flow takes."""
    return math.ceil(gap / longest * _ROUNDING) or 1


def segments(t: float, times: Floats, longest: float, regime: int, each: int) -> tuple[Floats, Integers]:
    """The flow to every event and the event, one after the other, as the engine's tables have them.

    Parameters
    ----------
    t : float
        Where the run is.
    times : ndarray, shape (N,)
        When the events happen; ascending.
    longest : float
        The longest step.
    regime : int
        The same all the while.
    each : int
        How many actions an event has.

    Returns
    -------
    spans, counts : ndarray
        Without flows of no length.
    """
    count = times.size
    spans, counts = np.empty((2 * count, 4)), np.zeros((2 * count, 7), dtype=np.int64)
    before = np.append(t, times[:-1])
    gaps = times - before
    steps = np.maximum(np.ceil(gaps / longest * _ROUNDING), 1.0).astype(np.int64)
    spans[::2, ::2], spans[::2, 1::2] = before[:, None], times[:, None]
    counts[::2, 0], counts[::2, 2], counts[:, 3] = steps, steps, regime
    spans[1::2], counts[1::2, 0] = times[:, None], 1
    first = each * np.arange(count)
    counts[1::2, 4], counts[1::2, 5] = first, first + each
    happens = np.ones(2 * count, dtype=bool)
    happens[::2] = gaps > 0
    return spans[happens], counts[happens]
