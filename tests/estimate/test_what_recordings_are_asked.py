"""Observers of recordings that ask when the first sample came, or what inputs have been: the simulation's estimates."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import held_input, of_simulation, recording

from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared

DAMPED: Block = inline({"x1": "x2", "x2": "-x1 - 0.3*x2"}, "x1", initial={"x1": 1, "x2": 0.5})
KKL: Block = {"type": "kkl", "initial": {"x1": 0.2, "x2": 0.5}}


@pytest.mark.costly
@pytest.mark.parametrize("start", [0.0, 7.0])
def test_z_begins_at_the_first_sample_of_a_recording(start: float) -> None:
    run = prepare(
        experiment(
            DAMPED,
            {"K": KKL, "right": {**KKL, "initial": {"x1": 1, "x2": 0.5}}},
            step=0.01,
            time={"start": start, "end": start + 4, "output_step": 0.1},
            measurement={"sampling": {"period": 0.5, "offset": 0.75}},
        )
    )
    simulated, data = simulate_prepared(run), of_simulation(run)
    found = estimate(run.experiment.source, data, sensitivity=False)
    for label, one in simulated.observers.items():
        np.testing.assert_allclose(found.observers[label].xhat, one.xhat, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.observers["right"].xhat, simulated.x, atol=1e-8)


DRIVEN: Block = inline(
    {"x1": "x2", "x2": "-sin(x1) + u + v"},
    "x1",
    inputs={"u": "sin(2*t)", "v": "0.1*cos(t)"},
    initial={"x1": 1, "x2": 0},
)
MHE: Block = {"type": "mhe", "window": 3, "iterations": 2, "Q": {"x2": 0.1}, "R": 0.01, "initial": {"x1": 0, "x2": 0}}


@pytest.fixture(scope="module", name="driven", params=[0.0, 7.0])
def of_a_driven_plant(request: pytest.FixtureRequest) -> PreparedRun:
    time = {"start": request.param, "end": request.param + 3, "output_step": 0.1}
    return prepare(experiment(DRIVEN, {"M": MHE}, step=0.01, time=time, measurement={"sampling": {"period": 0.25}}))


@pytest.mark.costly
def test_inputs_that_are_functions_of_time_are_asked_for_in_recordings(driven: PreparedRun) -> None:
    simulated = simulate_prepared(driven)
    found = estimate(driven.experiment.source, of_simulation(driven), sensitivity=False)
    np.testing.assert_allclose(found.observers["M"].xhat, simulated.observers["M"].xhat, rtol=0, atol=1e-10)
    assert np.max(np.abs(found.observers["M"].xhat - simulated.x)[-1]) < 0.02


@pytest.mark.costly
def test_the_input_that_is_recorded_is_named(driven: PreparedRun) -> None:
    (y,) = of_simulation(driven).outputs.values()
    told = recording(y, v=held_input("v", y.taken, 0.1 * np.cos(y.taken)))
    with pytest.raises(ConfigError, match=r"M\.type: it asks for the inputs .*, not data or a law: v$"):
        estimate(driven.experiment.source, told, sensitivity=False)
