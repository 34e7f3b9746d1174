"""The plant by itself, which relative noise and the records of late measurements are computed from."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from examples import experiment

from hgorun.simulation.plant_alone import PlantRun

PULSES: dict[str, Any] = {  # a pulse begins at every multiple of ten, so at the start and at the end
    "states": ["x"],
    "dynamics": {"x": "u - x"},
    "output": "x",
    "inputs": {"u": "where(t - 10*floor(t/10) < 0.01, 50, 0)"},
    "initial": {"x": 0.4},
}


@pytest.mark.parametrize("stiff", [False, True])
def test_a_jump_at_the_end_of_the_run(stiff: bool) -> None:
    made = experiment(PULSES, {}, end=30, output_step=0.1)
    run = PlantRun(made.plant, made.time, 0.01, stiff=stiff)
    times = np.array([5.0, 29.999, 30.0])
    begun = 50 * (math.exp(0.01) - 1)  # what a pulse adds, counted from its beginning
    exact = [0.4 * math.exp(-t) + begun * sum(math.exp(start - t) for start in (0, 10, 20) if start < t) for t in times]
    np.testing.assert_allclose(run.at(times)[0][:, 0], exact, rtol=1e-6)
