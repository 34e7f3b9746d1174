"""Why an estimate has left the truth, where that is plain to see."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.engine.memory import Raw
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import SlidingMode
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import Floats, at, evaluate
from hgorun.symbolic.forms import ChosenChains

_GROWS = 1e-6  # of the fastest rate: a smaller one may be rounding of zero


def why_diverged(run: PreparedRun, raw: Raw, j: int) -> str | None:
    """The reason in words; None where it is neither of those that are looked for.

    Parameters
    ----------
    raw : Raw
        A run in which the observer was followed until its numbers overflowed.
    """
    block = run.observers[j]
    return _unstable_gain(run, raw, block) or singular(run, raw, block)


def singular(run: PreparedRun, raw: Raw, block: ObserverBlock) -> str | None:
    """When J, through whose inverse a constant gain corrects, became singular: its determinant changed its sign.

    Where the estimate is lost before its own determinant shows that, that of the true state does.
    """
    form = block.form
    if not isinstance(form, ChosenChains) or block.canonical or form.map == "chain":
        return None
    if sum(form.chains) != form.plant.n:  # corrected by least squares
        return None
    xhat = block.states["xhat"]
    rows = raw.rows[:, xhat.start : xhat.start + xhat.size, 0]
    rows = rows[np.all(np.isfinite(rows), axis=1)]
    truth = raw.rows[: len(rows) + 1, : form.plant.n, 0]
    x, p = form.plant.x, form.plant.p
    determinant = ca.Function("det", [x, p], [ca.det(form.jacobian)])
    for states in (rows, truth):
        values = evaluate(determinant, states, run.plant.parameters)[0].ravel()
        with np.errstate(invalid="ignore"):
            changed = np.flatnonzero(np.sign(values) != np.sign(values[0]))
        if changed.size:
            k = int(changed[0])
            when = np.interp(0.0, *_rising(values[k - 1 : k + 1], run.grid[k - 1 : k + 1]))
            return f"J became singular at t = {run.origin + float(when):.6g}"
    return None


def _rising(values: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Two points in ascending order of their values."""
    order = np.argsort(values)
    return values[order], times[order]


def _unstable_gain(run: PreparedRun, raw: Raw, block: ObserverBlock) -> str | None:
    """Small errors grow with a continuous output at the start, in the middle and at the end of the run.

    Not said of gains that are states, which follow the plant, and of what jumps or has no linearisation.
    """
    observer = block.observer
    if not isinstance(observer, ContinuousObserver) or isinstance(observer, SlidingMode):
        return None
    if "gain" in observer.roles(block.form).values():
        return None
    count = len(run.grid)
    rates = [_rate(run, block, row, raw.rows[row, : run.plant.model.n, 0]) for row in (0, count // 2, count - 1)]
    if not all(rate > 0 for rate in rates):
        return None
    return f"the gain is unstable on this plant: small errors grow like exp({min(rates):.3g} t)"


def _rate(run: PreparedRun, block: ObserverBlock, row: int, x: Floats) -> float:
    """The largest real part of the error dynamics' eigenvalues at a true state; 0 where it is small or not known."""
    structure, model, t = run.structure, run.plant.model, run.grid[row]
    own = slice(block.start, block.stop)
    z = np.zeros(structure.system.states)
    z[own] = run.numbers.z0[own]
    xhat = block.states["xhat"]
    try:
        z[xhat.start : xhat.start + xhat.size] = block.form.start(x, run.plant.parameters, block.canonical)
    except ValueError:  # the coordinates do not exist there
        return 0.0
    u = structure.inputs.along(np.array([t]), run.numbers.p, np.zeros((1, structure.system.states)))[0]
    matrix = at(_error_matrix(run, block), t, u, z, np.zeros(len(model.outputs)), run.numbers.p)[0]
    matrix = matrix.reshape(block.stop - block.start, -1)
    if not np.all(np.isfinite(matrix)):
        return 0.0
    eigenvalues = np.linalg.eigvals(matrix)
    largest = float(np.max(eigenvalues.real))
    return largest if largest > _GROWS * float(np.max(np.abs(eigenvalues))) else 0.0


def _error_matrix(run: PreparedRun, block: ObserverBlock) -> ca.Function:
    """The slopes of the observer's right-hand side in its own states, its innovation being C xhat - y."""
    structure, model = run.structure, run.plant.model
    t, z = ca.SX.sym("t"), ca.SX.sym("z", structure.system.states)
    u, e = ca.SX.sym("u", len(model.inputs)), ca.SX.sym("e", len(model.outputs))
    own = z[block.start : block.stop]
    placed = structure.observers[run.observers.index(block)]
    rate = placed.flow(t, u, structure.plant, z, e)[: block.stop - block.start]
    guess = placed.guess(t, u, structure.plant, z)
    slopes = ca.jacobian(rate, own) + ca.jacobian(rate, e) @ ca.jacobian(guess, own)
    return ca.Function("slopes", [t, u, z, e, structure.p], [ca.densify(slopes)])
