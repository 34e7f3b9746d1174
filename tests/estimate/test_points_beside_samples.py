"""Output points that rounding puts a hair before a sample show all of what is behind it, states and inputs."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

START, PERIOD = 3.6, 0.01
TAKEN = np.round(START + PERIOD * np.arange(60), 2)  # from the start they are not the multiples of the period
Y, U = 0.3 * np.sin(8 * (TAKEN - START)), 1.0 + np.arange(TAKEN.size) % 7
PLANT = inline({"a": "b", "b": "2*u - 3*b - c", "c": "0"}, {"y": "a"}, inputs={"u": "0"})


def config(block: Block) -> Block:
    return {
        "time": {"start": START, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": PLANT,
        "observers": {"O": {"initial": {"a": 0.1, "b": 0.0, "c": 0.0}, **block}},
        "measurement": {"sampling": {"period": PERIOD}},
        "solver": {"step": PERIOD / 4},
    }


def of_file(block: Block, changes: np.ndarray = TAKEN) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and inputs."""
    log = recording(signal("y", TAKEN, Y), u=held_input("u", changes, U))
    found = estimate(source(config(block)), log, sensitivity=False)
    assert found.u is not None
    return found.observers["O"].xhat, found.u


@pytest.mark.parametrize(
    "block",
    [
        {"type": "savgol", "window": 5},
        pytest.param({"type": "eso", "omega_o": 20.0}, marks=pytest.mark.slow),
        pytest.param({"type": "levant", "G": 50.0}, marks=pytest.mark.slow),
    ],
    ids=lambda block: str(block["type"]),
)
def test_a_file_has_the_bits_of_the_stream_beside_every_sample(block: Block) -> None:
    found, u = of_file(block)
    assert np.count_nonzero(PERIOD * np.arange(TAKEN.size) < TAKEN - START) > 5
    stream, rows = Estimator(Experiment(config(block)), inputs=["u"]), []
    for t, y, value in zip(TAKEN.tolist(), Y.tolist(), U.tolist(), strict=True):
        stream.update(t, {"y": y}, u={"u": value})
        rows.append(stream.estimate()["O"])
    np.testing.assert_array_equal(found, rows)
    np.testing.assert_array_equal(u[:, 0], U)


def test_inputs_of_a_clock_that_is_off_by_rounding_change_with_the_sample() -> None:
    block = {"type": "savgol", "window": 5}
    late = TAKEN + 1e-12  # closer than events are told apart
    late[[0, -1]] = TAKEN[[0, -1]]  # as the run begins and ends
    for one, other in zip(of_file(block), of_file(block, late), strict=True):
        np.testing.assert_array_equal(one, other)


def test_steps_of_any_length_leave_points_beside_samples_there() -> None:
    """With times since long ago rounding is more than a part of a short step."""
    far = {"time": {"start": START + 1e6, "end": float(TAKEN[-1]) + 1e6, "output_step": PERIOD}}
    taken = TAKEN + 1e6
    log = recording(signal("y", taken, Y), u=held_input("u", taken, U))
    rows = []
    for step in (PERIOD / 2, PERIOD / 500):
        block = config({"type": "savgol", "window": 5}) | far | {"solver": {"step": step}}
        rows.append(estimate(source(block), log, sensitivity=False).observers["O"].xhat)
    np.testing.assert_allclose(rows[0], rows[1], rtol=1e-9, atol=1e-9)
