"""How large noise, disturbance and delay get in a run, and what rounding adds to them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.analysis.convergence.charts import Chart
from hgorun.analysis.convergence.lipschitz import ranges
from hgorun.measurement.channels import Channel
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_PIECES = 4096  # of a stretch in which an expression of time is enclosed
_WIDER = 1.05  # what is known on a grid may be larger between its points
_ROUNDING = 4 * np.finfo(float).eps


@dataclass(frozen=True)
class Amplitudes:
    """Bounds on what drives an observer's error in a run.

    Attributes
    ----------
    noise : float
        delta_v: |v(t)|, the Euclidean norm where there are several outputs.
    disturbance : ndarray, shape (n,)
        delta_eps, coordinate by coordinate.
    rounding : ndarray, shape (n,)
        What the arithmetic of the simulation does to each coordinate, as a disturbance.
    delay : float
        d_M: how old the newest measurement gets; inf before the first one.
    remarks : tuple of str
    """

    noise: float
    disturbance: np.ndarray
    rounding: np.ndarray
    delay: float
    remarks: tuple[str, ...] = ()


def amplitudes(run: PreparedRun, chart: Chart, result: Result, truth: np.ndarray) -> Amplitudes:
    """All of them; ``truth`` is z along the run, shape (Nt, n)."""
    remarks = []
    unbounded = dict.fromkeys(i.type for c in run.channels for noise in c.noise for i in noise.random if not i.bounded)
    for kind in unbounded:
        remarks.append(f"{kind.capitalize()} noise has no bound: delta_v is the largest draw of this run")
    if run.plant.block.discretise:
        remarks.append("the plant is a difference equation")
    size = np.max(np.abs(result.y), axis=0, initial=0.0)
    noise = [_noise_of(c, float(top)) + _ROUNDING * float(top) for c, top in zip(run.channels, size, strict=True)]
    error = max(_ROUNDING, run.solver.rtol or 1e-8) if run.adaptive else _ROUNDING
    rounding = error * np.max(np.abs(truth), axis=0, initial=0.0) / run.step
    return Amplitudes(
        float(np.linalg.norm(noise)),
        _disturbance(run, chart, result),
        rounding,
        max(oldest(c, run.time.start, run.time.end) for c in run.channels),
        tuple(remarks),
    )


def oldest(channel: Channel, start: float, end: float) -> float:
    """How old the newest measurement of an output gets between start and end."""
    late = 0.0
    arrivals, taken = channel.samples.arrival[channel.samples.used], channel.samples.taken[channel.samples.used]
    for stretch in channel.stretches:
        if stretch.continuous:
            if not stretch.undelayed:
                late = max(late, float(np.max(stretch.delay_at(np.linspace(stretch.start, stretch.end, _PIECES)))))
            continue
        slack = 1e-9 * (end - start)
        since = np.searchsorted(arrivals, [stretch.start + slack, stretch.end + slack], side="right")
        if since[0] == 0 and (arrivals.size == 0 or arrivals[0] > start + slack):
            return np.inf
        inside = slice(max(int(since[0]) - 1, 0), int(since[1]))
        following = np.minimum(np.append(arrivals[inside][1:], stretch.end), stretch.end)
        late = max(late, float(np.max(following - taken[inside], initial=0.0)))
    return late


def _noise_of(channel: Channel, output: float) -> float:
    """The largest |v| of an output whose largest modulus is given."""
    found = 0.0
    for k, stretch in enumerate(channel.stretches):
        if stretch.continuous:
            functions = channel.noise[k].functions
            size = sum(item.bound(stretch.start, stretch.end) for item in functions) + _held(channel, k)
        else:
            mine = channel.samples.stretch == k
            times, numbers = channel.samples.arrival[mine], channel.samples.number[mine]
            values = channel.noise[k].sampled(times, numbers)
            size = float(np.max(np.abs(values), initial=0.0))
        found = max(found, size * output * _WIDER if stretch.multiplicative else size)
    return found


def _held(channel: Channel, k: int) -> float:
    """The largest that held draws were together."""
    times = np.append(channel.noise[k].change_times(), channel.stretches[k].start)
    return float(np.max(np.abs(channel.noise[k].held(times)), initial=0.0))


def _disturbance(run: PreparedRun, chart: Chart, result: Result) -> np.ndarray:
    """The largest |dz/dx d(t)|; enclosed where z is x, else on the output grid and 5 % more."""
    n, model = len(chart.names), run.plant.model
    if run.plant.disturbance.is_zero():
        return np.zeros(n)
    if chart.identity:
        low, high = ranges(run, run.plant.disturbance)
        return np.asarray(np.maximum(np.abs(low), np.abs(high)))
    pushed = ca.densify(chart.directions @ run.plant.disturbance)
    f = ca.Function("d", [model.t, model.x, model.p], [pushed])
    values = np.abs(np.asarray(f(ca.DM(result.time[None]), ca.DM(result.x.T), ca.DM(run.plant.parameters)).full()))
    return np.asarray(_WIDER * np.max(values, axis=1))
