"""Estimates that are bounded and wrong: observers that no longer follow what is measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import load, run

import hgorun
from hgorun.ensemble.growing import Sweep
from hgorun.simulation.divergence.verdict import astray, ends, may_be_astray, size_of

T = np.linspace(0, 10, 1001)[:, None]
LATE_POINTS = ends(1001)[1:]


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_the_rule_knows_no_units(unit: float) -> None:
    y = unit * np.cos(T)
    alternates = y + 5 * unit * np.sign(np.sin(30 * T)) * (T > 4)
    assert astray(y, y + 30 * unit * np.exp(-3 * T), unit, LATE_POINTS) is None
    assert astray(y, -y, unit, LATE_POINTS) is None  # as far as two of one size can be from each other
    assert astray(y, alternates, unit, LATE_POINTS) == (0, 401)
    assert astray(y, alternates, 3 * unit, LATE_POINTS) is None
    for yhat in (-y, alternates):
        late = np.max(np.abs(yhat - y)[LATE_POINTS], axis=0)
        assert may_be_astray(late, size_of(y, yhat)).tolist() == (yhat is alternates)


def test_who_follows_again_has_not_gone_astray() -> None:
    y, swings = np.cos(T), 9 * np.sign(np.sin(30 * T))
    assert astray(y, y + swings * ((T > 2) & (T < 5)), 1.0, LATE_POINTS) is None
    assert astray(y, y + swings * (((T > 2) & (T < 4)) | (T > 8)), 1.0, LATE_POINTS) == (0, 801)


def test_an_error_that_does_not_swing_is_of_the_model_or_a_transient() -> None:
    y = np.cos(T)
    assert astray(y, y + 9.0, 1.0, LATE_POINTS) is None
    assert astray(y, y + np.exp(T), 1.0, LATE_POINTS) is None
    assert astray(y, y + 9 * np.sin(T), 1.0, LATE_POINTS) is None  # three changes of sign


def test_a_run_in_which_everything_is_zero_says_nothing() -> None:
    assert astray(0 * T, np.sin(30 * T), 0.0, LATE_POINTS) is None


def test_the_size_is_that_of_all_states_and_first_errors() -> None:
    x = np.array([[1.0, -4.0], [2.0, 3.0]])
    assert size_of(x, x) == 4
    assert size_of(x, x + np.array([[0.0, 7.0], [9.0, 9.0]])) == 7
    assert size_of(x, x + np.array([[0.0, np.nan], [9.0, 9.0]])) == 4


@pytest.mark.parametrize(("count", "every"), [(2, 1), (11, 1), (1001, 1), (1001, 5), (6001, 3)])
def test_the_last_points_lie_on_the_grid_of_the_metrics(count: int, every: int) -> None:
    """Of these alone a sweep knows the errors."""
    first, *late = ends(count, every).tolist()
    assert first == 0
    assert late[-1] == count - 1
    assert all(point % every == 0 and point >= 0.9 * count - 1 for point in late)


def test_points_of_the_metrics_that_are_too_few_are_not_all() -> None:
    """Every fiftieth of the last hundred would be two."""
    assert ends(1001, 50).tolist() == ends(1001).tolist()


def van_der_pol(thetas: dict[str, float], measurement: dict[str, Any], **other: Any) -> dict[str, Any]:
    """The damping of this plant keeps whatever leaves it within bounds."""
    return {
        "time": {"end": 10, "output_step": 0.01},
        "plant": {"type": "van_der_pol", "initial": {"x1": 0, "x2": 1}},
        "measurement": measurement,
        "observers": {label: {"type": "shgo", "theta": theta} for label, theta in thetas.items()},
        "solver": {"step": 0.002, "method": "rk4"},
        **other,
    }


SAMPLED, LATE = {"sampling": {"period": 0.1}}, {"delay": 0.1}
NOISY = SAMPLED | {"noise": [{"type": "gaussian", "std": 0.05}]}


@pytest.mark.parametrize(
    ("measurement", "thetas"),
    [  # both poles at -theta: the error grows from 5.0 / theta on between samples, from 2.74 / theta on with a delay
        (SAMPLED, {"ok": 30, "diverged": 80}),
        (LATE, {"ok": 20, "diverged": 40}),
    ],
)
def test_gains_that_are_too_large_for_the_samples(
    measurement: dict[str, Any], thetas: dict[str, float], tmp_path: Path
) -> None:
    observers = run(tmp_path, van_der_pol(thetas, measurement)).observers
    assert {label: observer.status for label, observer in observers.items()} == {"ok": "ok", "diverged": "diverged"}
    assert observers["ok"].metrics["rmse"][0] < 1e-3
    assert observers["diverged"].reason is not None
    assert observers["diverged"].reason.startswith("its estimate of x1 errs by up to ")
    assert np.all(np.isinf(observers["diverged"].metrics["rmse"]))


def test_gains_that_are_too_large_for_anything(tmp_path: Path) -> None:
    """With an automatic step, which is as short as the observer needs."""
    config = van_der_pol({"S": 1e9}, SAMPLED, solver={"step": "auto"})
    assert run(tmp_path, config).status == "diverged"


RECORDED: list[dict[str, Any]] = [
    {"time": {"end": 10, "output_step": 0.1}},  # a point a sample: the errors seem to keep their sign
    {"time": {"end": 10, "output_step": 2.5}},
    {"metrics": {"record": 0.1}},
    {"metrics": {"record": 5}},
    {"metrics": {"record": 0.005}, "time": {"end": 10, "output_step": 5}},
]


@pytest.mark.costly
@pytest.mark.parametrize(
    ("solver", "records"),
    [({"step": 0.01, "method": "rk4"}, RECORDED), ({"step": "auto"}, RECORDED[:1])],
    ids=["given", "auto"],
)
def test_it_does_not_depend_on_what_is_recorded(
    solver: dict[str, Any], records: list[dict[str, Any]], tmp_path: Path
) -> None:
    """Both poles at -theta: small errors grow from 50 on, and 80 keeps the sign of its errors at the samples."""
    plant = {"states": ["p", "q"], "dynamics": {"p": "q", "q": "p - p**3 - 0.2*q"}, "output": "p"}
    duffing = {"plant": plant | {"initial": {"p": 1, "q": 0.5}}, "solver": solver}
    for recorded in records:
        found = run(tmp_path, van_der_pol({"A": 30, "B": 80}, SAMPLED, **duffing, **recorded)).observers
        assert {label: one.status for label, one in found.items()} == {"A": "ok", "B": "diverged"}, recorded


@pytest.mark.costly
@pytest.mark.parametrize("recorded", [RECORDED[0], RECORDED[3]])
def test_a_sweep_does_not_depend_on_it_either(recorded: dict[str, Any], tmp_path: Path) -> None:
    base = load(tmp_path, van_der_pol({"S": 1}, SAMPLED, **recorded))
    assert words(hgorun.sweep(base, {"observers.S.theta": [30.0, 80.0]})) == ["ok", "diverged"]


def words(swept: Sweep) -> list[str]:
    return [["ok", "inaccurate", "diverged", "undefined", "failed"][int(k)] for k in np.ravel(swept.status)]


@pytest.mark.costly
def test_a_sweep_says_it_as_a_run_alone_does(tmp_path: Path) -> None:
    """Of an output that is zero where the run begins, and with noise."""
    thetas = {"A": 3.0, "B": 30.0, "C": 80.0, "D": 100.0}
    alone = [one.status for one in run(tmp_path, van_der_pol(thetas, NOISY)).observers.values()]
    base = load(tmp_path, van_der_pol({"S": 1}, NOISY))
    assert words(hgorun.sweep(base, {"observers.S.theta": list(thetas.values())})) == alone
    assert alone[:2] == ["ok", "ok"]
    assert alone[3] == "diverged"


def test_a_sweep_sees_errors_after_the_window_of_its_metrics(tmp_path: Path) -> None:
    """The run ends between two samples, where the error is small."""
    other = {"time": {"end": 9.91, "output_step": 0.01}, "metrics": {"window": [0, 0.05]}}
    thetas = {f"S{k}": theta for k, theta in enumerate((30.0, 60.0, 70.0, 80.0, 90.0))}
    alone = [one.status for one in run(tmp_path, van_der_pol(thetas, SAMPLED, **other)).observers.values()]
    base = load(tmp_path, van_der_pol({"S": 1}, SAMPLED, **other))
    assert words(hgorun.sweep(base, {"observers.S.theta": list(thetas.values())})) == alone
    assert "ok" in alone
    assert "diverged" in alone


START = {"initial": {"x1": 0.01, "x2": 0}}
FAR_IN_X2 = {"S": {"type": "shgo", "theta": 5, "initial": {"x1": 0.01, "x2": 3}}}
QUIET = {  # the second output is next to nothing beside the first
    "states": ["x1", "x2", "d"],
    "dynamics": {"x1": "x2", "x2": "-x1 - x2 + d", "d": "0"},
    "output": {"a": "x1", "b": "x2 + 1e-12"},
    "initial": {"x1": 1, "x2": 0, "d": 1},
}
PUSHED = {  # the observers know nothing of what keeps it at rest
    "states": ["x1", "x2"],
    "dynamics": {"x1": "x2", "x2": "-x1 - x2 + 1"},
    "output": "x1",
    "initial": {"x1": 0.001, "x2": 0},
    "disturbance": {"x2": "-1"},
}
AT_REST = {"type": "integrator_chain", "n": 2, "phi": "0", "initial": {"x1": 0, "x2": 0}}
KALMAN = {"type": "ekf", "q": 0.01, "R": {"a": 0.0025, "b": 0.01}, "initial": {"x1": 1, "d": 1}}


@pytest.mark.parametrize(
    ("plant", "observers", "measurement", "end"),
    [
        pytest.param({"type": "van_der_pol"} | START, FAR_IN_X2, {"delay": 0.3}, 0.3, id="ends in the first transient"),
        pytest.param(
            {"type": "van_der_pol"} | START, FAR_IN_X2, {"sampling": {"period": 0.5}}, 0.4, id="ends before a sample"
        ),
        pytest.param(
            QUIET,
            {"K": KALMAN},
            SAMPLED | {"outputs": {"a": {"noise": [{"type": "gaussian", "std": 0.05}]}}},
            10,
            id="quiet output beside a noisy one",
        ),
        pytest.param(PUSHED, {"S": {"type": "shgo", "theta": 2}}, SAMPLED, 10, id="constant error of the model"),
        pytest.param(
            AT_REST,  # both poles at -theta: stable below 50
            {"S": {"type": "shgo", "theta": 45, "initial": {"x1": 0, "x2": 0}}},
            NOISY,
            10,
            id="noise that is amplified",
        ),
    ],
)
def test_an_observer_that_does_what_it_can_is_ok(
    plant: dict[str, Any], observers: dict[str, Any], measurement: dict[str, Any], end: float, tmp_path: Path
) -> None:
    time = {"end": end, "output_step": 0.01}
    config = {"time": time, "plant": plant, "measurement": measurement, "observers": observers}
    assert [one.reason for one in run(tmp_path, config).observers.values()] == [None]
