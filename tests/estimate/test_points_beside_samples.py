"""Output points that rounding puts a hair before a sample show all of what is behind it, states and inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.timeline.grid import EvenPoints

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


FILTER: Block = {"type": "ekf", "Q": {"b": 1.0}, "R": 0.01}
ADDED = np.cumsum(np.full(TAKEN.size, PERIOD)) - PERIOD + START  # as a logger counts that adds
LOGS = {"gap": np.delete(TAKEN, 20), "sums": ADDED, "far": TAKEN + 1e6}


def clock_of(taken: np.ndarray, step: float, **of_time: float) -> Block:
    times = {"start": float(taken[0]), "end": float(taken[-1]) + PERIOD / 2, **of_time}
    return config(FILTER) | {"time": times, "solver": {"step": step}}


@pytest.mark.parametrize("taken", LOGS.values(), ids=LOGS)
def test_points_at_samples_have_their_times_and_estimates_with_steps_of_any_length(taken: np.ndarray) -> None:
    values = 0.3 * np.sin(70.0 * (taken - taken[0]))
    log = recording(signal("y", taken, values), u=held_input("u", taken, U[: taken.size]))
    for step in (PERIOD, PERIOD / 100):
        found = estimate(source(clock_of(taken, step, output_step=PERIOD)), log, sensitivity=False)
        experiment = Experiment(clock_of(taken, step, output_step=PERIOD))
        stream, rows = Estimator(experiment, inputs=["u"]), []
        for t, y, value in zip(taken.tolist(), values.tolist(), U.tolist(), strict=False):
            stream.update(t, {"y": y}, u={"u": value})
            rows.append(stream.estimate()["O"])
        places = np.searchsorted(found.time, taken - PERIOD / 2)
        np.testing.assert_array_equal(found.time[places] - taken[0], taken - taken[0])
        np.testing.assert_array_equal(found.observers["O"].xhat[places], rows)
        assert found.u is not None
        np.testing.assert_array_equal(found.u[places, 0], U[: taken.size])


def test_the_grid_of_a_log_with_a_missing_sample_has_the_times_of_all_others() -> None:
    taken = np.round(np.delete(0.1 * np.arange(1500), 700), 1)
    block = config(FILTER)
    del block["time"]
    log = recording(signal("y", taken, np.sin(taken)), u=held_input("u", taken, taken))
    found = estimate(source(block | {"solver": {"step": 0.05}}), log, sensitivity=False)
    assert found.time.size == 1500
    np.testing.assert_array_equal(np.delete(found.time, 700), taken)


def test_a_held_out_sample_is_compared_behind_the_sample_that_it_is_beside() -> None:
    """Whatever the steps; the stamps of the two are rounded otherwise."""
    log = recording(signal("y", TAKEN, Y), u=held_input("u", TAKEN, U))
    beside = {"b": signal("b", TAKEN[5::9] - 1e-13, np.zeros(7))}
    residuals = []
    for step in (PERIOD, PERIOD / 1000):
        found = estimate(
            source(clock_of(TAKEN, step, output_step=PERIOD)), replace(log, reference=beside), sensitivity=False
        )
        assert found.observers["O"].assessed is not None
        residuals.append(found.observers["O"].assessed.scores["reference_rmse"]["b"])
    assert residuals[0] == pytest.approx(residuals[1], rel=1e-5)


@pytest.mark.parametrize("count", [1, 3, 40])
def test_points_are_those_of_the_whole_and_of_several_samples_the_last(count: int) -> None:
    even = EvenPoints(count, 0.7)
    clock = np.sort(np.concatenate([0.7 * np.arange(40) - 3e-10, 0.7 * np.arange(0, 40, 3) + 2e-10, [0.4]]))
    clocks = (clock + 5.0, 5.0), (np.arange(40.0) * 0.7, 0.0)
    points = OutputPoints(even=even, clocks=clocks, end=30.0, tolerance=7e-10)
    whole = points[:]
    expected = 0.7 * np.arange(count)
    expected[::3] += 2e-10
    np.testing.assert_allclose(whole, expected, rtol=0, atol=4e-15)
    np.testing.assert_array_equal(points.at_samples(whole), whole)
    for first in range(count):
        np.testing.assert_array_equal(points[first : first + 2], whole[first : first + 2])
    for sought in (*whole, *np.nextafter(whole, np.inf), *np.nextafter(whole, -np.inf), -1.0, 0.3, 300.0):
        assert points.before(float(sought)) == np.searchsorted(whole, sought)
    assert points[:0].size == 0
