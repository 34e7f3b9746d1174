"""What is continuous: outputs and inputs that are held or go on straight lines, against the engine with the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from examples import Block, experiment, inline
from exported_c import Compiled, load_all

from hgorun import simulate
from hgorun.engine.memory import Start
from hgorun.export.prepared import Wanted, exported
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.structure import parameter_values, structure_of
from hgorun.simulation.system.truth import Recording
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.tables import build_plan
from hgorun.simulation.timeline.timeline import Stepping, Timeline

PLANT = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "0.3"})
OBSERVERS: dict[str, Block] = {
    "F": {"type": "fhgo2", "theta": 2, "r": 1, "initial": {"b": 1}},
    "R": {"type": "shgo_riccati", "theta": 2},
}
HOLD, END = 0.05, 3.0


def run_of(delay: str, noise: list[Block], period: float | None = None) -> PreparedRun:
    sampling = {} if period is None else {"sampling": {"period": period}}
    measurement: Block = {"delay": delay, "noise": noise, **sampling}
    return prepare(experiment(PLANT, OBSERVERS, end=END, step=0.01, measurement=measurement))


def recorded(run: PreparedRun, values: np.ndarray | None, inputs: RecordedInputs | None = None) -> np.ndarray:
    """The estimates at the run's events, of the engine: outputs are the values, held; (events, observers n)."""
    truth, designs = (
        Recording(run.plant.symbolic, () if inputs is None else (0,)),
        list(run.experiment.designs.values()),
    )
    structure = structure_of([truth], [designs], run.experiment.stretches, run.schedule.variants, run.plant.everything)
    samples = None if run.channels[0].stretches[0].continuous else [np.asarray(values)]
    plan = build_plan(
        Timeline(schedule=run.schedule, channels=run.channels, grid=run.schedule.events, reach=run.reach),
        structure.system,
        Stepping(longest=run.step),
        inputs=inputs,
        samples=samples,
    )
    if samples is None:
        holds = plan.holds.copy()
        holds[: len(values)] = values  # type: ignore[arg-type]  # noise held on an output that is zero
        plan = replace(plan, holds=holds)
    p = parameter_values(run.plant.everything, run.experiment.stretches, designs)
    z0 = [d.initial(run.plant, has_alpha=structure.system.has_alpha, recorded=run.recorded) for d in designs]
    raw = structure.program("rk4").run(plan, Start(np.concatenate(z0)[:, None], p[:, None]))
    found = structure.estimates_along(run.schedule.events, p, raw.rows[:, :, 0])
    return np.hstack([found.of(j) for j in range(len(designs))])


def compare(own: list[np.ndarray], theirs: np.ndarray) -> None:
    scale = np.max(np.abs(theirs))
    assert np.ptp(theirs) > 0.5
    assert np.max(np.abs(np.array(own) - theirs)) <= 1e-12 * scale


@pytest.mark.measured("0.1 + 0.05*sin(3*t)")
@pytest.mark.slow
@pytest.mark.parametrize("delay", ["0", "0.12", "0.1 + 0.05*sin(3*t)"])
def test_held_outputs(delay: str, tmp_path: Path) -> None:
    run = run_of(delay, [{"type": "gaussian", "std": 0.1, "hold": HOLD}])
    changes = run.channels[0].held_changes[0]
    values = np.sin(3 * changes)
    compiled = list(load_all(tmp_path, exported(run)).values())
    own = []
    for t in run.schedule.events:
        new = values[np.isclose(changes, t, rtol=0, atol=1e-12)]
        for observer in compiled:
            assert observer.predict(t) == 0
            if new.size:
                assert observer.measure(t, [new[0]], 1) == 0
        own.append(np.concatenate([observer.estimate for observer in compiled]))
    compare(own, recorded(run, values))


@pytest.mark.costly
def test_inputs_that_are_told(tmp_path: Path) -> None:
    """On straight lines from one time to the next, and held before."""
    run = run_of("0.15", [], period=0.1)
    at = run.schedule.events[[0, 8, 20, 30]]
    levels, slopes = np.array([[0.5], [0.5], [0.2], [-0.4]]), np.array([[0.0], [0.4], [-0.3], [0.0]])
    values = np.cos(2 * run.channels[0].samples.arrival)
    inputs = RecordedInputs(at, levels, slopes)
    compiled = list(load_all(tmp_path, exported(run, Wanted(inputs_given=True))).values())
    own = []
    for k, t in enumerate(run.schedule.events):
        for observer in compiled:
            assert observer.predict(t) == 0
            _tell(observer, at, levels, slopes, t)
            for taken, y in _arriving(run, values, k):
                assert observer.update(taken, [y], 1) == 0
        own.append(np.concatenate([observer.estimate for observer in compiled]))
    compare(own, recorded(run, values, inputs))


def _tell(observer: Compiled, at: np.ndarray, levels: np.ndarray, slopes: np.ndarray, t: float) -> None:
    """At the start of a line its value, then the value at its end."""
    for i in np.flatnonzero(at == t):
        end = at[i + 1] if i + 1 < len(at) else END
        assert observer.input(t, levels[i]) == 0
        assert observer.input(end, levels[i] + slopes[i] * (end - t)) == 0


def _arriving(run: PreparedRun, values: np.ndarray, event: int) -> list[tuple[float, float]]:
    samples, events = run.channels[0].samples, run.schedule.events
    at = np.abs(samples.arrival[:, None] - events).argmin(axis=1)
    taken = events[np.abs(samples.taken[:, None] - events).argmin(axis=1)]
    return [(float(taken[k]), float(values[k])) for k in np.flatnonzero(at == event)]


@pytest.mark.costly
def test_lines_come_nearer_to_the_output_than_held_values(tmp_path: Path) -> None:
    """Told every 0.05: the estimate of the simulation, with an error of second order, or of first order."""
    run = run_of("0", [])
    times = np.linspace(0, END, 61)
    result = simulate(run.experiment.varied({"time.output_step": 0.05}))
    y, theirs = result.y[:, 0], result.observers["F"].xhat
    errors = {}
    for ahead in (True, False):
        (tmp_path / str(ahead)).mkdir()
        observer = load_all(tmp_path / str(ahead), exported(run))["F"]
        observer.measure(0.0, [y[0]], 1)
        own = [observer.estimate]
        for t, value in zip(times[1:], y[1:], strict=True):
            if ahead:
                observer.measure(t, [value], 1)
            observer.predict(t)
            if not ahead:
                observer.measure(t, [value], 1)
            own.append(observer.estimate)
        errors[ahead] = np.max(np.abs(np.array(own) - theirs))
    assert errors[True] < 1e-3 < 1e-2 < errors[False]
