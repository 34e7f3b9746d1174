"""What a run has left in the engine's arrays, as a result."""

from __future__ import annotations

from dataclasses import asdict

import casadi as ca
import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.engine.program import Raw
from hgorun.measurement.availability import evaluate
from hgorun.measurement.events import merge
from hgorun.measurement.schedule import nearest_event
from hgorun.result.data import Measurements, ObserverResult
from hgorun.result.measure import measure
from hgorun.result.result import Result
from hgorun.result.windows import MetricSettings
from hgorun.simulation.run import Run


def record(run: Run, raw: Raw) -> Result:
    """Trajectories in the plant's coordinates, on the output grid, with metrics from the metric grid."""
    s, model, blocks = run.system, run.plant.model, run.blocks
    _, every_output, every_metric = run.experiment.grid
    rows = raw.rows[:, :, 0]
    u, y, *estimates = (np.asarray(v.full()).T for v in s.report(ca.DM(run.grid[None, :]), ca.DM(s.p), ca.DM(rows.T)))
    x = rows[:, : model.n]
    settings = MetricSettings.of(blocks.metrics, run.time)
    metric = slice(None, None, every_metric)
    shown = slice(None, None, every_output)
    labels = [b.label for b in s.observers]
    measured = {label: xhat[metric] for label, xhat in zip(labels, estimates, strict=True)}
    metrics = measure(run.grid[metric], x[metric], measured, settings)
    found = {}
    for j, (b, xhat) in enumerate(zip(s.observers, estimates, strict=True)):
        lost_at = float(raw.diverged[j, 0])
        found[b.label] = ObserverResult(
            b.observer.type,
            np.ascontiguousarray(xhat[shown]),
            {name: st.shaped(rows[shown]) for name, st in b.states.items() if name != "xhat" and st.size},
            {name: np.asarray(value).tolist() for name, value in b.design.items()},
            sum(st.size for name, st in b.states.items() if name != "alpha"),
            lost_at if np.isfinite(lost_at) else None,
            metrics[b.label],
        )
    embedded = None
    if METHODS[run.solver.method].error:
        blocks_of = {"plant": (0, model.n)} | {b.label: (b.start, b.stop) for b in s.observers}
        embedded = {label: float(np.max(raw.error[a:b])) for label, (a, b) in blocks_of.items()}
    units = {"time": run.time.unit, **run.plant.units}
    return Result(
        run.experiment.name,
        blocks.title,
        run.grid[shown].copy(),
        np.ascontiguousarray(x[shown]),
        u[shown].copy(),
        y[shown].copy(),
        model.states,
        model.inputs,
        model.outputs,
        units,
        _measurements(run, raw, y[shown]),
        found,
        run.experiment.text,
        run.experiment.resolved_text,
        blocks.seed,
        asdict(settings),
        embedded,
        blocks.figures,
    )


def _measurements(run: Run, raw: Raw, y: np.ndarray) -> Measurements:
    """Samples at their arrival, continuous outputs on the output grid."""
    grid = run.grid[:: run.experiment.grid[1]]
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    base = 0
    for i, c in enumerate(run.channels):
        count = c.samples.arrival.size
        times, taken = [c.samples.arrival], [c.samples.taken]
        values = [raw.measured[base : base + count, 0]]
        base += count
        on_grid = c.stretch_at(grid)
        for k, stretch in enumerate(c.stretches):
            if stretch.continuous:
                mine = on_grid == k
                t, truth = grid[mine], y[mine, i]
                then = t
                if not stretch.undelayed:
                    then = np.maximum(t - stretch.delay_at(t), run.time.start)
                    order = np.argsort(then, kind="stable")
                    late = np.empty_like(truth)
                    late[order] = run.plant_alone.at(then[order])[0][:, i]
                    truth = late
                times.append(t)
                taken.append(then)
                values.append(_noisy(run, i, k, t, truth))
        parts.append((np.concatenate(times), np.concatenate(taken), np.concatenate(values)))
    # arrivals that are one event are one row, in spite of rounding
    union = merge(np.concatenate([part[0] for part in parts]), 1e-9 * run.step)
    taken_all, y_all = (np.full((union.size, len(parts)), np.nan) for _ in range(2))
    for i, part in enumerate(parts):
        where = nearest_event(union, part[0]) if union.size > 1 else np.zeros(part[0].size, dtype=int)
        taken_all[where, i], y_all[where, i] = part[1], part[2]
    return Measurements(union, taken_all, y_all)


def _noisy(run: Run, i: int, k: int, t: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """A continuous output with its noise."""
    signal = run.signals[i, k]
    f = ca.Function("v", [run.plant.model.t, run.parameters.symbol], [signal.noise])
    v = evaluate(f, t, run.parameters.values) + run.channels[i].noise[k].held(t)
    return np.asarray(truth * (1 + v) if signal.multiplicative else truth + v)
