"""From the engine's arrays to the result of a run."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.errors import NoStep, Problem
from hgorun.measurement.events import merge
from hgorun.measurement.in_order import NoiseInOrder
from hgorun.measurement.long import LongSchedule
from hgorun.measurement.noise import StretchNoise
from hgorun.measurement.schedule import nearest_event
from hgorun.measurement.signals import noise_at
from hgorun.memo import Memo, same
from hgorun.result.evaluation.measure import from_origin
from hgorun.result.records.data import PLANT, DesignNumbers, Integration, Measurements
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.status import OK, Verdict
from hgorun.result.result import Result
from hgorun.result.windows import MetricSettings
from hgorun.simulation.outcome.closed import closed_loops, outputs_at
from hgorun.simulation.outcome.left_out import remarks_of_late
from hgorun.simulation.outcome.measured import Measured
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock

_KEPT = 1_000_000  # numbers of an array that is kept in memory
_INPUTS: Memo[np.ndarray] = Memo(8, lambda u: u.size < _KEPT)
Places = np.ndarray | slice
_ROWS: Memo[tuple[np.ndarray, list[Places]]] = Memo(8, lambda rows: rows[0].size * len(rows[1]) < _KEPT)


def record(
    run: PreparedRun,
    raw: Raw,
    found: Measured,
    integration: Integration,
    of_plant: Verdict = OK,
    *,
    grid: np.ndarray | None = None,
) -> Result:
    """Trajectories in the plant's coordinates, on the output grid, with metrics from the metric grid.

    Parameters
    ----------
    run, raw, found, integration
        The run, what it has given, and how.
    of_plant : Verdict
        What is said of the plant.
    grid : ndarray, optional
        The times that ``found`` has rows of, where these are not those of the output grid.
    """
    numbers, blocks, model, origin = run.numbers, run.experiment.blocks, run.plant.model, run.origin
    if grid is None:
        grid = run.grid[:: run.experiment.grid[1]]
    loops = closed_loops(run, raw, found)
    u = loops[PLANT].u if loops else _inputs(run, grid)
    y = outputs_of(run, grid, found.rows)
    return Result(
        name=run.experiment.name,
        title=blocks.title,
        time=origin + grid,
        x=found.x,
        u=u.copy(),
        y=y,
        states=model.states,
        inputs=model.inputs,
        outputs=model.outputs,
        units={"time": run.time.unit, **run.plant.units},
        measurements=_measurements(run, raw, grid, y, integration),
        observers=_observers(run, found),
        config=run.experiment.text,
        resolved=run.experiment.resolved_later,
        seed=blocks.seed,
        windows=found.settings.told(),
        integration=integration,
        verdict=of_plant,
        measures=model.measures,
        remarks=(*run.remarks, *remarks_of_late(run)),
        design=DesignNumbers(numbers.p, numbers.z0, run.step),
        closed_loop=loops,
    )


def outputs_of(run: PreparedRun, grid: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The noise-free outputs at some times, shape (len(grid), q).

    Raises
    ------
    Problem
        When one of them is not finite.
    """
    y = np.ascontiguousarray(run.structure.outputs.along(grid, run.numbers.p, rows))
    if not np.all(np.isfinite(y)):
        row, column = np.argwhere(~np.isfinite(y))[0]
        when = run.origin + grid[row]
        raise Problem(("plant",), f"output {run.plant.model.outputs[column]} is not a finite number at t = {when:g}")
    return y


def measured_at_once(run: PreparedRun) -> bool:
    """Whether all outputs are continuous all the time, and known without delay."""
    return all(len(c.stretches) == 1 and c.stretches[0].continuous and c.stretches[0].undelayed for c in run.channels)


def noise_along(run: PreparedRun) -> list[list[StretchNoise]]:
    """The noise of every output, for times that are asked for in their order: of every stretch."""
    if isinstance(run.schedule, LongSchedule):
        return [[NoiseInOrder(noise) for noise in c.noise] for c in run.channels]
    return [c.noise for c in run.channels]


def continuous_measurements(
    run: PreparedRun, noises: list[list[StretchNoise]], grid: np.ndarray, y: np.ndarray
) -> Measurements:
    """What is measured at some times of outputs that are :func:`measured_at_once`.

    Parameters
    ----------
    noises : list of list of StretchNoise
        As :func:`noise_along`, from one part of the run to the next.
    grid, y : ndarray, shapes (N,) and (N, q)
        The times, and the outputs without noise.
    """
    columns = []
    for i, (c, (noise,)) in enumerate(zip(run.channels, noises, strict=True)):
        (stretch,) = c.stretches
        v = noise_at(stretch, grid) + noise.held(grid)
        columns.append(run.plant.model.wrapped(i, y[:, i] * (1 + v) if stretch.multiplicative else y[:, i] + v))
    taken = np.repeat((run.origin + grid)[:, None], len(columns), axis=1)
    return Measurements(time=run.origin + grid, taken=taken, y=np.column_stack(columns))


def _observers(run: PreparedRun, measured: Measured) -> dict[str, ObserverResult]:
    """Every observer's part of the result."""
    metrics = from_origin(measured.metrics, run.origin) if run.origin else measured.metrics
    found, coordinates = {}, run.experiment.coordinates
    for j, (b, verdict) in enumerate(zip(run.observers, measured.verdicts, strict=True)):
        # where an estimate is lost, the metrics' own grid may have missed it
        own = {name: np.full_like(values[j], np.inf) if verdict.lost else values[j] for name, values in metrics.items()}
        found[b.label] = ObserverResult(
            type=b.observer.type,
            xhat=measured.estimates.of(j),
            internal=internal(b, measured.rows),
            gains={name: np.asarray(value).tolist() for name, value in b.design.items()},
            dimension=sum(st.size for name, st in b.states.items() if name != "alpha"),
            verdict=verdict if verdict.at is None else replace(verdict, at=run.origin + verdict.at),
            metrics=own,
            coordinates=coordinates.get(b.label),
            unestimated=b.observer.unestimated(b.form),
        )
    return {label: found[label] for label in run.experiment.observers}


def internal(block: ObserverBlock, rows: np.ndarray) -> dict[str, np.ndarray]:
    """The internal states of an observer along a run, in their own shapes."""
    return {name: st.shaped(rows) for name, st in block.states.items() if name != "xhat" and st.size}


def since_start(run: PreparedRun, result: Result) -> Result:
    """A run's result on the run's own clock, which counts time from its start, as all that is prepared does."""
    if not run.origin:
        return result
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time)
    return replace(
        result,
        time=run.grid[:: run.experiment.grid[1]].copy(),
        windows=settings.since(run.origin).told(),
        measurements=result.measurements.since(run.origin),
        observers={
            label: replace(one, verdict=one.verdict.since(run.origin), metrics=from_origin(one.metrics, -run.origin))
            for label, one in result.observers.items()
        },
    )


def _inputs(run: PreparedRun, times: np.ndarray) -> np.ndarray:
    """u(t), which runs of one family share."""
    key = run.structure.groups[0].truth.plant, run.plant.everything.tobytes(), same(run.grid), times.size
    return _INPUTS.get(key, lambda: inputs_of(run, times))


def inputs_of(run: PreparedRun, times: np.ndarray) -> np.ndarray:
    """u(t), which does not depend on what the observers do."""
    return run.structure.inputs.along(times, run.numbers.p, np.zeros(run.structure.system.states))


def _measurements(
    run: PreparedRun, raw: Raw, grid: np.ndarray, y: np.ndarray, integration: Integration
) -> Measurements:
    """Samples at their arrival, continuous outputs on the output grid."""
    noises = noise_along(run)
    if not grid.size and measured_at_once(run):
        return continuous_measurements(run, noises, grid, y)
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    base, every, long = 0, run.schedule.every, isinstance(run.schedule, LongSchedule)
    for i, c in enumerate(run.channels):
        samples = c.samples.part(0, c.samples.size, every) if long else c.samples
        times, taken = [samples.arrival], [samples.taken]
        values = [raw.measured[base : base + samples.size, 0]]
        base += samples.size
        continuous = [k for k, stretch in enumerate(c.stretches) if stretch.continuous]
        on_grid = c.stretch_at(grid) if continuous and len(c.stretches) > 1 else None
        for k in continuous:
            stretch, inside = c.stretches[k], slice(None) if on_grid is None else on_grid == k
            t, truth = grid[inside], y[inside, i]
            then = t
            if not stretch.undelayed:
                then = np.maximum(t - stretch.delay_at(t), run.time.start)
                order = np.argsort(then, kind="stable")
                late = np.empty_like(truth)
                late[order] = _outputs(run, integration, then[order])[:, i]
                truth = late
            times.append(t)
            taken.append(then)
            v = noise_at(stretch, t) + noises[i][k].held(t)
            values.append(truth * (1 + v) if stretch.multiplicative else truth + v)
        parts.append((_joined(times), _joined(taken), run.plant.model.wrapped(i, _joined(values))))
    key = same(run.schedule), same(run.grid)  # of which runs of one family have the same ones
    union, places = _ROWS.get(key, lambda: _rows([part[0] for part in parts], 1e-9 * run.step))
    if len(parts) == 1 and isinstance(places[0], slice):
        return Measurements(run.origin + union, run.origin + parts[0][1][:, None], parts[0][2][:, None].copy(), every)
    taken_all, y_all = (np.full((union.size, len(parts)), np.nan) for _ in range(2))
    for i, (part, where) in enumerate(zip(parts, places, strict=True)):
        taken_all[where, i], y_all[where, i] = part[1], part[2]
    return Measurements(time=run.origin + union, taken=run.origin + taken_all, y=y_all, every=every)


def _outputs(run: PreparedRun, integration: Integration, times: np.ndarray) -> np.ndarray:
    """At increasing times, shape (len(times), q)."""
    if not run.closed:
        with suppress(NoStep):  # controlled steps do not follow a state that sticks where the equations jump
            return run.plant_alone.at(times)[0]
    return outputs_at(run, integration, times)


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    """One after the other; the only one that is not empty as it is."""
    filled = [part for part in parts if part.size]
    return filled[0] if len(filled) == 1 else np.concatenate(parts)


def _rows(times: list[np.ndarray], tolerance: float) -> tuple[np.ndarray, list[Places]]:
    """The times of all outputs' measurements, and where among them those of each are.

    Arrivals that are one event are one row, in spite of rounding.
    """
    if len(times) == 1 and np.all(np.diff(times[0]) > tolerance):  # so do most, and there may be many of them
        return times[0], [slice(None)]
    union = merge(np.concatenate(times), tolerance)
    if union.size < 2:
        return union, [np.zeros(one.size, dtype=int) for one in times]
    return union, [nearest_event(union, one) for one in times]
