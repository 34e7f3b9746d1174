"""Where the range of theta with which an observer finds the state ends below, found by simulating again and again."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from hgorun.analysis.reasons import NoValue
from hgorun.errors import HgorunError
from hgorun.measurement.blocks import noise_blocks
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import simulate

_LEFT = 0.01  # of the error at the start: what may be left in the last tenth of the run
_DOUBLINGS = 10  # up or down from the configured theta
_PRECISION = 0.02  # relatively


def critical_theta(experiment: Experiment, label: str, theta: float) -> float:
    """The largest theta that fails below an observer's working range, to 2 %: one that works, a theta 2 % less fails.

    Without noise and disturbance, in the configured run: an observer works when its error in the last tenth of
    the run is at most 1 % of that at the start, in every state. Its working range holds the configured theta, or is
    the next one above. The search halves theta until that fails, or doubles it until it succeeds, and then bisects.
    It is a border, not necessarily the only one: a smaller theta may work again, a gap of less than a factor of
    2 can be missed, and where outputs are sampled or late too large a theta fails, too.

    Raises
    ------
    NoValue
        When there is no border near.
    """
    return smallest(partial(works, _quiet(experiment, label), label), theta)


def smallest(works: Callable[[float], bool], theta: float) -> float:
    """The border above which ``works``, near theta; NoValue where there is none."""
    step = 0.5 if works(theta) else 2.0
    good, bad = (theta, None) if step < 1 else (None, theta)
    for _ in range(_DOUBLINGS):
        theta *= step
        if works(theta) == (step < 1):
            good, bad = (theta, bad) if step < 1 else (good, theta)
        else:
            good, bad = (good, theta) if step < 1 else (theta, bad)
            break
    if good is None:
        raise NoValue(f"the error has not decayed to 1 % by the end of the run with any theta tried, up to {theta:.4g}")
    if bad is None:
        raise NoValue(f"the error decays to 1 % by itself, with every theta tried, down to {theta:.4g}")
    while good > (1 + _PRECISION) * bad:
        middle = float(np.sqrt(good * bad))
        good, bad = (middle, bad) if works(middle) else (good, middle)
    return good


def works(experiment: Experiment, label: str, theta: float) -> bool:
    """Whether the observer finds the state in a run of its own."""
    try:
        result = simulate(experiment.varied({f"observers.{label}.theta": theta}))
    except HgorunError:  # a run that would take forever, or a gain beyond double precision
        return False
    error = np.abs(result.observers[label].xhat - result.x)
    if result.observers[label].lost:
        return False
    last = error[-max(len(error) // 10, 1) :]
    return bool(np.all(np.max(last, axis=0) <= _LEFT * np.linalg.norm(error[0])))


def _quiet(experiment: Experiment, label: str) -> Experiment:
    """The experiment without noise and disturbance, with one observer."""
    left_out = ["plant.disturbance", "metrics", *(path for path, _ in noise_blocks(experiment.measurement))]
    left_out += [f"observers.{other}" for other in experiment.observers if other != label]
    return experiment.varied(dict.fromkeys(left_out))
