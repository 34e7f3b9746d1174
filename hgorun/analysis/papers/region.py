"""Where a run goes: its states, and points of the box around them, to take the largest value of a function over."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import casadi as ca
import numpy as np

from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.points import generator

_POINTS, _MAX_CORNERS, _MAX_TIMES = 2_000, 1_024, 2_000


@dataclass(frozen=True)
class Points:
    """Times (M,) and states (M, n) at which a function of t, x, u(t) and the parameters is looked at."""

    t: np.ndarray
    x: np.ndarray


def along(times: np.ndarray, x: np.ndarray) -> Points:
    """A trajectory, at most 2,000 of its points."""
    step = max(times.size // _MAX_TIMES, 1)
    return Points(times[::step], x[::step])


def box(times: np.ndarray, low: np.ndarray, high: np.ndarray) -> Points:
    """Corners of a box and points drawn inside it, the same at every call, each at one of the times."""
    random = generator()
    inside = random.uniform(low, high, (_POINTS, low.size))
    if 2**low.size <= _MAX_CORNERS:
        corners = np.array(list(product(*zip(low, high, strict=True))))
        inside = np.concatenate([corners, inside])
    return Points(random.choice(times, len(inside)), inside)


def evaluated(run: PreparedRun, expression: ca.SX, x: ca.SX, points: Points) -> np.ndarray:
    """An expression of t, x (this symbol), the plant's inputs and its parameters at many points.

    The inputs are the symbols ``run.plant.model.u``.

    Returns
    -------
    ndarray, shape (M, rows, columns)
    """
    model = run.plant.model
    expression = ca.substitute(ca.SX(expression), model.u, run.plant.inputs) if model.u.numel() else ca.SX(expression)
    function = ca.Function("g", [model.t, x, model.p], [ca.densify(expression)])
    values = np.asarray(
        function(ca.DM(points.t[None, :]), ca.DM(points.x.T), ca.DM(run.plant.parameters)).full(), dtype=float
    )
    rows, columns = expression.shape
    return np.ascontiguousarray(values.reshape(rows, points.t.size, columns).swapaxes(0, 1))
