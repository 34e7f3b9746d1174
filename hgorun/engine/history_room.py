"""How much of its past a run keeps for continuous delays."""

from __future__ import annotations

import numpy as np

from hgorun.engine.history import piece_words
from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Floats, Integers

ADAPTIVE_HISTORY = 1 << 16  # pieces kept where the number of steps is not known before


def history_pieces(ends: Floats, steps: Integers | None, reach: float) -> int:
    """How many steps the history of continuous delays keeps: a power of two.

    Parameters
    ----------
    ends : ndarray, shape (segments, 2)
        Where each segment starts and ends; pieces of one segment may repeat them.
    steps : ndarray, shape (segments,)
        Steps of each of them; None for adaptive steps.
    reach : float
        The longest delay; room is left for one that is a tenth longer.
    """
    if steps is None:
        return ADAPTIVE_HISTORY
    last = np.append(ends[1:, 1] > ends[:-1, 1], True)
    knots = np.append(ends[0, 0], ends[last, 1])
    done = np.append(0, np.cumsum(steps)[last])
    reach = 1.1 * reach
    # steps in [t - reach, t] are most where one of the two is at an event
    late = np.concatenate([knots, knots + reach])
    spanned = np.interp(late, knots, done) - np.interp(late - reach, knots, done)
    return 1 << (int(np.ceil(np.max(spanned))) + 4).bit_length()


def history_bytes(system: HybridSystem, pieces: int) -> int:
    """Memory of so many steps of history, for one lane."""
    return 8 * pieces * piece_words(system.outputs * system.width, 1)
