"""Whether the gain of an observer has come to rest at the end of a run on chains of integrators."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.error_system import error_system, last_points
from hgorun.analysis.reasons import NoValue
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_POINTS = 4  # of which error_system takes the last three
_NEAR = 1e-2  # relative distance from where the error's system rests


def require_rest(run: PreparedRun, label: str, result: Result) -> None:
    """Refuse a run at whose end the error's system is still on its way.

    How far it has to go follows from its last two changes, in equal times: of an exponential these are in geometric
    progression.

    Raises
    ------
    NoValue
    """
    block = next(b for b in run.observers if b.label == label)
    if not set(block.states) - {"xhat", "alpha"}:
        return
    system = error_system(run, label, last_points(result, _POINTS))
    if system.constant:
        return
    before, after = (float(np.max(np.abs(change))) for change in np.diff(system.G, axis=0))
    if not after < before or after**2 / (before - after) > _NEAR * np.max(np.abs(system.G[-1])):
        raise NoValue(
            f"its gain has not come to rest on chains of integrators by t = {result.time[-1]:.4g}: its class has to "
            "declare the rate at which it does (settling_rate)"
        )
