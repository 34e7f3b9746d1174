"""Lipschitz constants of the nonlinearity phi that an observer copies, in the coordinates of its theory.

|phi_k(u, zhat) - phi_k(u, z)| <= sum over i of M_ki |zhat_i - z_i|, with M_ki the largest |d phi_k/d z_i| in a
box that holds both. L_k = max over i of M_ki and L_phi = max over k of L_k are the constants of (3.8) and
(3.16) of Robles Magdaleno 2023.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.analysis.convergence.charts import Chart
from hgorun.analysis.convergence.segments import Trajectories, along
from hgorun.memo import Memo, same
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.enclosures import Enclosure, Extent, largest
from hgorun.symbolic.graph import operations

_MARGIN = 0.05  # of the width of a box around trajectories, on either side: they are known on a grid
_PIECES = 1024  # of the time in which an input is enclosed
_POINTS = 2000  # of a trajectory that slopes are evaluated at
_INPUTS: Memo[tuple[np.ndarray, np.ndarray]] = Memo(16)  # between what they stay during a run
_JUMPING: Memo[bool] = Memo(64)  # charts
_JUMPS = {ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}


@dataclass(frozen=True)
class Lipschitz:
    """Bounds on the slopes of phi.

    Attributes
    ----------
    slopes, reached : ndarray, shape (n, n)
        M: no slope is larger where ``kind`` is an interval's; and the largest that was met.
    kind : str
        ``interval over box``: bounds by interval arithmetic. ``interval along run``: the same on the segments
        between simulated truth and estimate, where the box has points that are not states. ``trajectory``: the
        largest slopes met along truth and estimate, no bounds.
    region : str
        Where the box comes from.
    box : mapping of str to (low, high)
    positions : ndarray of int, shape (n,)
        Place in its chain of each coordinate, from 0.
    remarks : tuple of str
        What keeps the theory from applying.
    """

    slopes: np.ndarray
    reached: np.ndarray
    kind: str
    region: str
    box: dict[str, tuple[float, float]]
    positions: np.ndarray
    remarks: tuple[str, ...] = field(default=())

    @property
    def value(self) -> float:
        """L_phi of (3.16)."""
        return float(np.max(self.slopes, initial=0.0))

    @property
    def seen(self) -> float:
        """The largest slope met."""
        return float(np.max(self.reached, initial=0.0))

    @cached_property
    def of_outputs(self) -> float:
        """The same for what moves the outputs alone, and never above their norm: L_phi in (3.77)."""
        first = self.positions == 0
        return max(self.value, float(np.linalg.norm(self.slopes[np.ix_(first, first)], 2)) if first.any() else 0.0)

    def constant(self, theta: float) -> float:
        """c_1 of (3.42): |Phi~| <= c_1 |zbar| where zbar_i = theta^(1-i) z_i.

        The norm of the matrix M_ki theta^(i-k). It falls with theta when phi is triangular; at theta = 1 it is at
        most n L_phi, (3.17).
        """
        scale = float(theta) ** -self.positions.astype(float)
        scaled = scale[:, None] * self.slopes / scale
        return float(np.linalg.svd(scaled, compute_uv=False).max()) if self.slopes.size else 0.0


def lipschitz(
    run: PreparedRun,
    trajectories: Trajectories,
    saturation: dict[str, tuple[float, float]],
    met: np.ndarray,
    reach: np.ndarray | None = None,
) -> Lipschitz:
    """Bound the slopes of phi over the box of an observer's saturation, or of its simulated run.

    Parameters
    ----------
    saturation : mapping
        Bounds on the arguments of phi, in the chart's coordinates.
    met : ndarray, shape (n, n)
        The largest slopes on both trajectories, of :func:`slopes_met`.
    reach : ndarray, shape (n,), optional
        How far the estimate may be from the truth, where the run's grid is too coarse to show it.
    """
    chart = trajectories.chart
    low, high, where = _around(trajectories, reach)
    remarks = []
    limited = {name: bounds for name, bounds in saturation.items() if name in chart.names}
    for name, (below, above) in limited.items():
        i = chart.names.index(name)
        if np.min(trajectories.z[:, i]) < below or np.max(trajectories.z[:, i]) > above:
            remarks.append(
                f"{name} leaves the saturation [{below:g}, {above:g}]: the observer's copy is another plant there"
            )
        low[i], high[i] = below, above
    region = "saturation" if len(limited) == len(chart.names) else where
    if limited and len(limited) < len(chart.names):
        region = f"saturation of {', '.join(limited)}; else {region}"
    reached = met
    box = {name: (float(a), float(b)) for name, a, b in zip(chart.names, low, high, strict=True)}
    slopes, kind = reached, "trajectory"
    if chart.invertible:
        bounds, inside = _over_box(run, chart, low, high)
        if np.all(np.isfinite(bounds)):
            slopes, reached, kind = bounds, np.maximum(inside, reached), "interval over box"
    if kind == "trajectory":
        bounds = along(trajectories)
        if np.all(np.isfinite(bounds)):
            # a mean slope may be less than the largest one met: the larger is the safe one
            slopes, kind = np.maximum(bounds, reached), "interval along run"
            region = "between simulated truth and estimate"
    above_ = chart.positions[None, :] > chart.positions[:, None]
    stray = float(np.max(reached, where=above_, initial=0.0))
    if stray > 1e-7 * (1 + np.max(reached, initial=0.0)):
        remarks.append("phi is not triangular: a component depends on a coordinate further down its chains")
    if _jumps(chart):
        remarks.append("phi is switched (sign, floor, a comparison): its slopes say nothing of its jumps")
    triangle = ~above_
    return Lipschitz(slopes * triangle, reached * triangle, kind, region, box, chart.positions, tuple(remarks))


def _around(trajectories: Trajectories, reach: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, str]:
    """A box around both trajectories: its lower and upper bounds, shape (n,) each, and where it comes from."""
    truth, estimate = trajectories.z, trajectories.zhat
    known = np.isfinite(trajectories.xhat).all(axis=1) & np.isfinite(estimate).all(axis=1)
    points = [truth, estimate if known.all() else estimate[known]]
    where = "simulated truth and estimate, 5 % wider"
    if reach is not None:
        points = [truth - reach, truth + reach]
        where = "simulated truth and the transient that is bounded, since the output grid misses its peak"
    columns = [np.concatenate([part[:, i] for part in points]) for i in range(truth.shape[1])]
    low, high = np.array([np.min(v) for v in columns]), np.array([np.max(v) for v in columns])
    slack = _MARGIN * (high - low)
    return low - slack, high + slack, where


def slopes_met(chart: Chart, result: Result, trajectory: np.ndarray) -> np.ndarray:
    """The largest slopes on a trajectory of the plant's states, (Nt, n) of a run: shape (n, n)."""
    kept = slice(None, None, max(1, len(result.time) // _POINTS))
    stack = np.abs(chart.slopes_at(result.time[kept], trajectory[kept], result.u[kept]))
    return np.asarray(np.max(stack, axis=0, initial=0.0, where=np.isfinite(stack)))


def _over_box(run: PreparedRun, chart: Chart, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the slopes over a box of coordinates and everything that inputs and time do, and slopes met.

    The first slope without a bound ends it: the box is of no use then.
    """
    start, end = run.time.start, run.time.end
    below, above = _INPUTS.get((same(chart.inputs), start, end), lambda: _between(chart.inputs, start, end))
    low, high = np.concatenate([low, below, [start]]), np.concatenate([high, above, [end]])
    n = len(chart.names)
    bounds, met = np.zeros((n, n)), np.zeros((n, n))
    known: dict[Enclosure, Extent] = {}
    for at, entry in chart.entries.items():
        extent = known[entry] if entry in known else known.setdefault(entry, largest(entry, low, high))
        bounds[at], met[at] = extent.bound, extent.reached
        if not np.isfinite(extent.bound):
            break
    return bounds, met


def ranges(run: PreparedRun, signals: ca.SX) -> tuple[np.ndarray, np.ndarray]:
    """Between what functions of time and the plant's parameters stay during the run, shapes (m,) and (m,)."""
    model = run.plant.model
    values = ca.densify(ca.substitute(signals, model.p, ca.DM(run.plant.parameters)))
    return _between(Enclosure(ca.Function("u", [model.t], [values])), run.time.start, run.time.end)


def _between(signals: Enclosure, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Between what functions of time stay from start to end, shapes (m,) and (m,)."""
    edges = np.linspace(start, end, _PIECES + 1)[:, None]
    low, high = signals.each(edges[:-1], edges[1:])
    return np.min(low, axis=0), np.max(high, axis=0)


def _jumps(chart: Chart) -> bool:
    """Whether phi has an operation that jumps with the state."""
    return _JUMPING.get(
        same(chart),
        lambda: any(node.op() in _JUMPS and ca.depends_on(node, chart.x) for node in operations([chart.field])),
    )
