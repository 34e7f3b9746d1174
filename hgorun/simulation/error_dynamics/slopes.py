"""The slopes of an observer's equations in its own states and in the innovation."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.simulation.error_dynamics.filters_at_rest import rates_and_sizes
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.states import StateBlock


def slopes(run: PreparedRun, block: ObserverBlock) -> ca.Function:
    """From (t, p, z, e) to A0, E, H, L, K0, K.

    With xi the observer's states without alpha and e the innovation, of small deviations

        d xi' = A0 d xi + E de,    d(C xhat) = H d xi,    dxhat = L d xi,    dc = K0 d xi + K de

    where c enters alpha' = -c. Shapes (N, N), (N, q), (q, N), (n, N), (q, N), (q, q).
    """
    model, p = run.plant.model, run.structure.plant
    t = model.t
    u = inputs_of(run)
    z = ca.SX.sym("z", run.structure.system.states)
    e = ca.SX.sym("e", len(model.outputs))
    derivatives, correction = block.equations(block.copy(t, u, p), block.symbols(z), e)
    rate = ca.vertcat(*[block.states[n].flat(derivatives[n]) for n in block.states if n != "alpha"])
    xi = z[block.start : block.stop]
    parts = [
        ca.jacobian(rate, xi),
        ca.jacobian(rate, e),
        ca.jacobian(block.guess(t, u, p, z), xi),
        ca.jacobian(block.estimate(t, u, p, z), xi),
        ca.jacobian(correction, xi),
        ca.jacobian(correction, e),
    ]
    return ca.Function("linear", [t, run.structure.p, z, e], [ca.densify(part) for part in parts])


def filter_rates(run: PreparedRun, block: ObserverBlock, filters: Mapping[str, StateBlock]) -> ca.Function:
    """From (t, p, z) to how fast filters move without innovation, and the size of what they move by."""
    model = run.plant.model
    z, still = ca.SX.sym("z", run.structure.system.states), ca.SX.zeros(len(model.outputs))
    copy = block.copy(model.t, inputs_of(run), run.structure.plant)
    derivatives, _ = block.equations(copy, block.symbols(z), still)
    return ca.Function("filters", [model.t, run.structure.p, z], rates_and_sizes(derivatives, filters, z))


def inputs_of(run: PreparedRun) -> ca.SX:
    """The plant's inputs, in the symbols of the run's equations; those that are recorded as they are at its start."""
    u = ca.SX(ca.substitute(run.plant.inputs, run.plant.model.p, run.structure.plant))
    for number, value, _ in run.recorded:
        u[number] = value
    return u


def at_truth(run: PreparedRun, block: ObserverBlock, x: Floats) -> Floats:
    """All states where an observer estimates a true state, and is as at the start else; zero of others.

    Parameters
    ----------
    x : ndarray, shape (n,)

    Raises
    ------
    ValueError
        Where the observer's coordinates do not exist.
    """
    own, xhat = slice(block.start, block.stop), block.states["xhat"]
    z = np.zeros(run.structure.system.states)
    z[own] = run.numbers.z0[own]
    estimate = np.asarray(block.form.start(x, run.plant.parameters, block.canonical))
    z[xhat.start : xhat.start + xhat.size] = block.observer.start(estimate, block.design)
    return z
