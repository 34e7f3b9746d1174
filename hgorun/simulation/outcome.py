"""From the engine's arrays to the result of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from hgorun.engine.program import Raw
from hgorun.errors import Problem
from hgorun.measurement.events import merge
from hgorun.measurement.schedule import nearest_event
from hgorun.measurement.signals import noise_at
from hgorun.memo import Memo
from hgorun.result.data import PLANT, DesignNumbers, Integration, Measurements, ObserverResult
from hgorun.result.measure import from_origin
from hgorun.result.result import Result
from hgorun.result.status import OK, Verdict
from hgorun.result.windows import MetricSettings
from hgorun.simulation.measured import Measured
from hgorun.simulation.prepared import PreparedRun

_INPUTS: Memo[np.ndarray] = Memo(8, lambda u: u.size < 1_000_000)


def record(
    run: PreparedRun, raw: Raw, found: Measured, integration: Integration, verdicts: Mapping[str, Verdict]
) -> Result:
    """Trajectories in the plant's coordinates, on the output grid, with metrics from the metric grid.

    Parameters
    ----------
    run, raw, found, integration
        The run, what it has given, and how.
    verdicts : mapping of str to Verdict
        Of the plant and of the observers that are not plainly ok, with times since the run's origin.
    """
    structure, numbers, blocks, model = run.structure, run.numbers, run.experiment.blocks, run.plant.model
    shown, origin = slice(None, None, run.experiment.grid[1]), run.origin
    rows = raw.rows[:, :, 0]
    grid = run.grid[shown].copy()
    u = _inputs(run, grid)
    y = structure.outputs.along(grid, numbers.p, rows[shown])
    bad = np.argwhere(~np.isfinite(y))
    if bad.size:
        row, column = bad[0]
        when = origin + grid[row]
        raise Problem(("plant",), f"output {model.outputs[column]} is not a finite number at t = {when:g}")
    observers = {}
    for b in numbers.observers:
        verdict = verdicts.get(b.label, found.undefined.get(b.label, OK))
        numbers_of = from_origin(found.metrics[b.label], origin) if origin else found.metrics[b.label]
        if verdict.lost:  # the metrics' own grid may have missed it
            numbers_of = {name: np.full(model.n, np.inf) for name in numbers_of}
        observers[b.label] = ObserverResult(
            type=b.observer.type,
            xhat=found.estimates[b.label],
            internal={name: st.shaped(rows[shown]) for name, st in b.states.items() if name != "xhat" and st.size},
            gains={name: np.asarray(value).tolist() for name, value in b.design.items()},
            dimension=sum(st.size for name, st in b.states.items() if name != "alpha"),
            verdict=verdict if verdict.at is None else replace(verdict, at=origin + verdict.at),
            metrics=numbers_of,
            coordinates=run.experiment.coordinates.get(b.label),
        )
    return Result(
        name=run.experiment.name,
        title=blocks.title,
        time=origin + grid,
        x=found.x,
        u=u.copy(),
        y=np.ascontiguousarray(y),
        states=model.states,
        inputs=model.inputs,
        outputs=model.outputs,
        units={"time": run.time.unit, **run.plant.units},
        measurements=_measurements(run, raw, grid, y),
        observers=observers,
        config=run.experiment.text,
        resolved=run.experiment.resolved_later,
        seed=blocks.seed,
        windows=asdict(found.settings),
        integration=integration,
        verdict=verdicts.get(PLANT, OK),
        measures=model.measures,
        remarks=run.remarks,
        design=DesignNumbers(numbers.p, numbers.z0, run.step),
    )


def since_start(run: PreparedRun, result: Result) -> Result:
    """A run's result on the run's own clock, which counts time from its start, as all that is prepared does."""
    if not run.origin:
        return result
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time)
    return replace(
        result,
        time=run.grid[:: run.experiment.grid[1]].copy(),
        windows=asdict(settings.since(run.origin)),
        measurements=result.measurements.since(run.origin),
        observers={
            label: replace(one, verdict=one.verdict.since(run.origin), metrics=from_origin(one.metrics, -run.origin))
            for label, one in result.observers.items()
        },
    )


def _inputs(run: PreparedRun, times: np.ndarray) -> np.ndarray:
    """u(t), which does not depend on what the observers do."""
    key = run.structure.groups[0].truth.plant, run.plant.everything.tobytes(), times.tobytes()
    nothing = np.zeros(run.structure.system.states)
    return _INPUTS.get(key, lambda: run.structure.inputs.along(times, run.numbers.p, nothing))


def _measurements(run: PreparedRun, raw: Raw, grid: np.ndarray, y: np.ndarray) -> Measurements:
    """Samples at their arrival, continuous outputs on the output grid."""
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    base = 0
    for i, c in enumerate(run.channels):
        count = c.samples.arrival.size
        times, taken = [c.samples.arrival], [c.samples.taken]
        values = [raw.measured[base : base + count, 0]]
        base += count
        continuous = [k for k, stretch in enumerate(c.stretches) if stretch.continuous]
        on_grid = c.stretch_at(grid) if continuous else grid
        for k in continuous:
            stretch, inside = c.stretches[k], on_grid == k
            t, truth = grid[inside], y[inside, i]
            then = t
            if not stretch.undelayed:
                then = np.maximum(t - stretch.delay_at(t), run.time.start)
                order = np.argsort(then, kind="stable")
                late = np.empty_like(truth)
                late[order] = run.plant_alone.at(then[order])[0][:, i]
                truth = late
            times.append(t)
            taken.append(then)
            v = noise_at(stretch, t) + c.noise[k].held(t)
            values.append(truth * (1 + v) if stretch.multiplicative else truth + v)
        measured = run.plant.model.wrapped(i, np.concatenate(values))
        parts.append((np.concatenate(times), np.concatenate(taken), measured))
    # arrivals that are one event are one row, in spite of rounding
    union = merge(np.concatenate([part[0] for part in parts]), 1e-9 * run.step)
    taken_all, y_all = (np.full((union.size, len(parts)), np.nan) for _ in range(2))
    for i, part in enumerate(parts):
        where = nearest_event(union, part[0]) if union.size > 1 else np.zeros(part[0].size, dtype=int)
        taken_all[where, i], y_all[where, i] = part[1], part[2]
    return Measurements(time=run.origin + union, taken=run.origin + taken_all, y=y_all)
