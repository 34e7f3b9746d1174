"""Estimates that are bounded and wrong: observers that no longer follow what is measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import load, run

import hgorun
from hgorun.simulation.verdict import astray, may_be_astray

T = np.linspace(0, 10, 1001)[:, None]
QUIET = np.zeros(1)


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_the_rule_knows_no_units(unit: float) -> None:
    y = unit * np.cos(T)
    alternates = y + 5 * unit * np.sign(np.sin(30 * T)) * (T > 4)
    assert astray(y, y + 30 * unit * np.exp(-3 * T), QUIET) is None
    assert astray(y, -y, QUIET) is None  # as far as two of one size can be from each other
    found = astray(y, alternates, QUIET)
    assert found is not None
    assert found == (0, 401)
    assert astray(y, alternates, np.full(1, 2 * unit)) is None
    for yhat in (-y, alternates):
        assert may_be_astray(y[[0, -3, -2, -1]], yhat[[0, -3, -2, -1]]).tolist() == (yhat is alternates)


def test_who_follows_again_has_not_gone_astray() -> None:
    y = np.cos(T)
    assert astray(y, y + 9.0 * ((T > 2) & (T < 5)), QUIET) is None
    found = astray(y, y + 9.0 * (((T > 2) & (T < 4)) | (T > 8)), QUIET)
    assert found is not None
    assert found[1] == 801


def test_an_output_that_is_zero_says_nothing() -> None:
    assert astray(0 * T, np.sin(T), QUIET) is None
    assert not may_be_astray(0 * T, np.sin(T))


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
NOISY = SAMPLED | {"noise": [{"type": "gaussian", "std": 1.0}]}


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


def test_a_sweep_says_it_as_a_run_alone_does(tmp_path: Path) -> None:
    """Of an output that is zero where the run begins, and with noise as large as it."""
    thetas = {"A": 3.0, "B": 30.0, "C": 80.0, "D": 100.0}
    alone = [one.status for one in run(tmp_path, van_der_pol(thetas, NOISY)).observers.values()]
    base = load(tmp_path, van_der_pol({"S": 1}, NOISY))
    swept = hgorun.sweep(base, {"observers.S.theta": list(thetas.values())})
    words = ["ok", "inaccurate", "diverged", "undefined", "failed"]
    assert [words[int(k)] for k in np.ravel(swept.status)] == alone
    assert alone[:2] == ["ok", "ok"]
    assert alone[3] == "diverged"
