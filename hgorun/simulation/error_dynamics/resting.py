"""Where the gain of an observer rests that follows a differential equation along the estimate."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from hgorun.simulation.error_dynamics.slopes import inputs_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.evaluate import Floats, at

_STILL = 1e-3  # of its size, by which a gain may still move in the time of the run
_ACCURACY = 1e-6


class Unsettled(Exception):
    """A gain has not come to rest."""


def at_rest(run: PreparedRun, block: ObserverBlock, gains: Sequence[str], t: float, p: Floats, z: Floats) -> Floats:
    """The states with the gain that an estimate leads to which stands still for the time of the run.

    Parameters
    ----------
    gains : sequence of str
        The states that are the gain.
    t : float
    p, z : ndarray
        All parameters and states.

    Raises
    ------
    Unsettled
        Where it has not come to rest by then.
    """
    from scipy.integrate import solve_ivp  # only where an estimate is lost

    own = [block.states[name] for name in gains]
    places = np.concatenate([np.arange(one.start, one.start + one.size) for one in own])
    rate, e = _rate(run, block, gains), np.zeros(len(run.plant.model.outputs))

    def moved(_: float, gain: Floats) -> Floats:
        there = z.copy()
        there[places] = gain
        return np.ravel(at(rate, t, p, there, e)[0])

    with np.errstate(all="ignore"):
        found = solve_ivp(moved, (0.0, run.span), z[places], "LSODA", rtol=_ACCURACY, atol=_ACCURACY)
        gain = found.y[:, -1]
        still = np.max(np.abs(moved(0.0, gain))) * run.span <= _STILL * np.max(np.abs(gain))
    if not (found.success and still):
        raise Unsettled
    there = z.copy()
    there[places] = gain
    return there


def _rate(run: PreparedRun, block: ObserverBlock, gains: Sequence[str]) -> ca.Function:
    """How the gain moves, from (t, p, z, e)."""
    model, p = run.plant.model, run.structure.plant
    u = inputs_of(run)
    z = ca.SX.sym("z", run.structure.system.states)
    e = ca.SX.sym("e", len(model.outputs))
    derivatives, _ = block.equations(block.copy(model.t, u, p), block.symbols(z), e)
    rates = ca.vertcat(*[block.states[name].flat(derivatives[name]) for name in gains])
    return ca.Function("rate", [model.t, run.structure.p, z, e], [ca.densify(rates)])
