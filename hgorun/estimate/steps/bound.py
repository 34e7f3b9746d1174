"""Beyond which bound an observer of recorded data is lost: a file and a stream follow one rule."""

from __future__ import annotations

import numpy as np

from hgorun.engine.memory import Start
from hgorun.symbolic.evaluate import Floats

_BEYOND = 1e12  # times all that is known by then, whatever the units


def beginning_of(z: Floats, p: Floats, given: float | None, w: Floats | None = None, largest: float = 1.0) -> Start:
    """Where a run begins, with its bound: a given one, or 1e12 times all that is known by then.

    That is 1, the states at the start and every sample that has arrived.

    Parameters
    ----------
    z, p : ndarray, shape (states,), (parameters,)
    given : float or None
        ``solver.divergence``.
    w : ndarray, optional
        What is held, where the run goes on from another one.
    largest : float
        What was the largest there.
    """
    bound = (0.0, _BEYOND) if given is None else (given, 0.0)
    return Start(z[:, None], p[:, None], bound, w, largest if w is not None else known_at(z))


def known_at(z: Floats) -> float:
    """The largest number among states at the start, at least 1; those that are not known yet count for nothing."""
    return float(np.max(np.abs(z[np.isfinite(z)]), initial=1.0))


def bound_with(given: float | None, largest: float) -> float:
    """The bound where that is the largest number which is known."""
    return _BEYOND * largest if given is None else given
