"""Observers on arrays of samples and inputs: bit for bit the numbers of the simulated run that these come from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import Block, chain, experiment, inline

from hgorun.engine.memory import Start
from hgorun.measurement.schedule import build_schedule, nearest_event
from hgorun.observers.base import SampledObserver
from hgorun.simulation.passes.passes import as_given, integrate
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.structure import parameter_values, structure_of
from hgorun.simulation.system.truth import Recording, SimulatedPlant
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.tables import build_plan
from hgorun.simulation.timeline.timeline import Stepping, Timeline

POLES: Block = {"theta": 2, "poles": -1}
FAMILIES: dict[str, Block] = {
    "shgo": POLES,
    "fhgo2": POLES | {"r": 2},
    "integral": POLES | {"r": 1},
    "treangle": POLES,
    "low_power": POLES,
    "shgo_riccati": {"theta": 2},
    "fhgo1": {"theta": 2, "delta": 4},
    "fhgo2_nuos": {"theta": 2, "r": 1},
}
PENDULUM = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "where(t < 2.05, 0.3, -0.2)"})
INPUT = RecordedInputs(np.array([0.0, 2.05]), np.array([[0.3], [-0.2]]), np.zeros((2, 1)))
HELD = replace(INPUT, held=True)
NOISE = [{"type": "gaussian", "std": 0.05}]


def recorded(run: PreparedRun, inputs: RecordedInputs | None = None) -> np.ndarray:
    """The observers' states on what the simulated run has measured, shape (rows, states)."""
    raw, designs = integrate(run, as_given(run)), list(run.experiment.designs.values())
    counts = np.cumsum([c.samples.arrival.size for c in run.channels])[:-1]
    samples = np.split(raw.measured[:, 0], counts)
    schedule = run.schedule
    if inputs is not None and run.plant.symbolic.numbers.numel() > 1:  # changes are where the expression has its kinks
        events = schedule.events
        inputs = replace(inputs, times=events[nearest_event(events, inputs.times)])
    truth = Recording(run.plant.symbolic, () if inputs is None else (0,))
    structure = structure_of([truth], [designs], run.experiment.stretches, schedule.variants, run.plant.everything)
    assert structure.system.plant_states == 0
    plan = build_plan(
        Timeline(schedule=schedule, channels=run.channels, grid=run.grid),
        structure.system,
        Stepping(longest=run.step),
        inputs=inputs,
        samples=samples,
    )
    p = parameter_values(run.plant.everything, run.experiment.stretches, designs)
    z0 = [d.initial(run.plant, has_alpha=structure.system.has_alpha, recorded=run.recorded) for d in designs]
    program = structure.program(run.solver.given_method)
    return program.run(plan, Start(np.concatenate(z0)[:, None], p[:, None])).rows[:, :, 0]


def assert_same_bits(run: PreparedRun, inputs: RecordedInputs | None = None) -> None:
    simulated = integrate(run, as_given(run)).rows[:, run.plant.model.n :, 0]
    assert np.array_equal(recorded(run, inputs), simulated)
    assert np.ptp(simulated, axis=0).max() > 0.1  # something has happened


@pytest.mark.costly
@pytest.mark.parametrize("delay", ["0", "0.15", "0.1 + 0.05*sin(3*t)"])
@pytest.mark.parametrize(
    "inputs", [None, INPUT, HELD], ids=["input of time", "input with slopes of zero", "held input"]
)
def test_every_family_on_samples(delay: str, inputs: RecordedInputs | None) -> None:
    measurement = {"sampling": {"period": 0.1, "jitter": 0.02}, "delay": delay, "noise": NOISE}
    observers = {name: {"type": name, **keys, "initial": {"b": 1}} for name, keys in FAMILIES.items()}
    assert_same_bits(prepare(experiment(PENDULUM, observers, end=4, step=0.01, measurement=measurement)), inputs)


@pytest.mark.costly
@pytest.mark.parametrize(
    "inputs", [None, INPUT, HELD], ids=["input of time", "input with slopes of zero", "held input"]
)
def test_observers_that_jump_at_samples(inputs: RecordedInputs | None) -> None:
    observers: dict[str, Block] = {
        "reduced": {"type": "reduced_sampled", "H": 3, "initial": {"b": 1}},
        "deadbeat": {"type": "deadbeat"},
    }
    run = prepare(experiment(PENDULUM, observers, end=4, step=0.01, measurement={"sampling": {"period": 0.1}}))
    assert all(isinstance(b.observer, SampledObserver) for b in run.observers)
    assert_same_bits(run, inputs)


@pytest.mark.costly
def test_two_outputs_sampled_on_their_own() -> None:
    plant = inline({"a": "b", "b": "-a + c", "c": "d", "d": "-c - a*b"}, ["a", "c"])
    measurement = {
        "noise": NOISE,
        "outputs": {"a": {"sampling": {"period": 0.1}}, "c": {"sampling": {"period": 0.17}, "delay": 0.05}},
    }
    observers = {name: {"type": name, **FAMILIES[name]} for name in ("shgo", "fhgo2", "shgo_riccati")}
    assert_same_bits(prepare(experiment(plant, observers, end=4, step=0.01, measurement=measurement)))


def test_an_input_of_straight_lines() -> None:
    """u = 0.5 t as lines of that slope, set every second: to the rounding of their levels."""
    plant = inline({"a": "b", "b": "-a + u"}, "a", inputs={"u": "0.5*t"})
    run = prepare(
        experiment(plant, {"o": {"type": "shgo", **POLES}}, end=4, step=0.01, measurement={"sampling": {"period": 0.1}})
    )
    times = np.arange(4.0)
    lines = RecordedInputs(times, 0.5 * times[:, None], np.full((4, 1), 0.5))
    simulated = integrate(run, as_given(run)).rows[:, 2:, 0]
    np.testing.assert_allclose(recorded(run, lines), simulated, rtol=0, atol=1e-13)


@pytest.mark.costly
def test_groups_with_plants_of_their_own() -> None:
    """Two observers with a copy of the plant each are two runs side by side."""
    plant, measurement = chain(2, "-x1", 1.0), {"sampling": {"period": 0.1}, "delay": 0.03}
    blocks = {"o": {"type": "fhgo2", **POLES}, "r": {"type": "shgo_riccati", "theta": 3}}
    run = prepare(experiment(plant, blocks, end=3, step=0.01, measurement=measurement))
    designs = list(run.experiment.designs.values())
    truth = SimulatedPlant(run.plant.symbolic)
    stretches = [*run.experiment.stretches, *run.experiment.stretches]
    channels = [*run.channels, *run.channels]
    schedule = build_schedule(channels, run.time, np.zeros(0), run.step)
    structure = structure_of([truth, truth], [[d] for d in designs], stretches, schedule.variants, run.plant.everything)
    timeline = Timeline(schedule=schedule, channels=channels, grid=run.grid)
    plan = build_plan(timeline, structure.system, Stepping(longest=run.step))
    x0 = run.plant.initial
    first, second = (d.initial(run.plant, has_alpha=True, recorded=run.recorded) for d in designs)
    z0 = np.concatenate([x0, first, x0, second, [0.0]])
    p = parameter_values(run.plant.everything, stretches, designs)
    rows = structure.program("rk4").run(plan, Start(z0[:, None], p[:, None])).rows[:, :, 0]
    together = integrate(run, as_given(run)).rows[:, :, 0]
    assert np.array_equal(rows[:, :2], together[:, :2])
    blocks_apart, blocks_together = structure.observers, run.observers
    for apart, beside in zip(blocks_apart, blocks_together, strict=True):
        assert np.array_equal(rows[:, apart.start : apart.end], together[:, beside.start : beside.end])
    assert np.array_equal(rows[:, -1], np.zeros(len(rows)))
