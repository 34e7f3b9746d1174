"""Why an estimate is not a number: in a jump, in a step, or where it is read from the observer's states."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline, simulated

from hgorun import simulate
from hgorun.result.records.status import OK
from hgorun.simulation.passes.loss import of_estimate
from hgorun.simulation.passes.passes import as_given, integrate
from hgorun.simulation.preparation.preparation import prepare


def test_a_root_in_a_jump() -> None:
    plant = inline({"x": "z", "z": "-sqrt(z)"}, "x", initial={"x": 0, "z": 1})
    measurement = {"sampling": {"period": 0.1}, "noise": [{"type": "uniform", "low": -1, "high": 1}]}
    observers: dict[str, Block] = {"D": {"type": "deadbeat", "initial": {"x": 0, "z": 0.01}}}
    found = simulate(experiment(plant, observers, end=1.5, step=1e-2, measurement=measurement)).observers["D"]
    assert found.status == "undefined"
    assert found.reason is not None
    assert found.reason.startswith("sqrt of a negative number (-")
    assert found.reason.endswith("at t = 0.2")


def test_a_root_in_a_step() -> None:
    plant = inline({"h1": "1 + 0.5*sin(t) - sqrt(h1)", "h2": "sqrt(h1) - sqrt(h2)"}, "h2", initial={"h1": 1, "h2": 1})
    noise = [{"type": "gaussian", "std": 0.01}]
    measurement = {"sampling": {"period": 0.1}, "delay": 0.05, "noise": noise}
    observers: dict[str, Block] = {"S": {"type": "shgo", "theta": 40, "initial": {"h1": 0.8, "h2": 0.8}}}
    found = simulate(experiment(plant, observers, end=2, step=1e-2, measurement=measurement)).observers["S"]
    assert found.status == "undefined"
    assert found.reason is not None
    assert found.reason.startswith("sqrt of a negative number (h1 = -")


@pytest.mark.costly
@pytest.mark.parametrize("solver", [{"step": "auto"}, {"method": "rodas5p"}], ids=["auto", "rodas5p"])
def test_a_logarithm_before_which_controlled_steps_end(solver: Block) -> None:
    """The gain takes the estimate of x2 from 0 to -2, where no step is small enough any more."""
    plant = inline({"x1": "x2", "x2": "log(x2 + 2) - x1"}, "x1", initial={"x1": 1, "x2": 0})
    observer: Block = {"type": "shgo", "theta": 20, "initial": {"x1": 3}}
    found = simulated(plant, {"S": observer}, end=1, output_step=0.01, solver=solver).observers["S"]
    assert found.status == "undefined"
    said = re.fullmatch(r"log of a number that is not positive \(x2 = -2\) at t = (\S+)", found.reason or "")
    assert said is not None
    # x2' = -400 (e1 = 2) at first, and e1' = x2 - 40 e1: about -800 t
    assert float(said[1]) == pytest.approx(2 / 800, rel=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("period", [0.25, 1.0])
def test_a_root_behind_a_jump_of_controlled_steps(period: float) -> None:
    """A sample takes the estimate of h1 below 0: h1+ = h1 + P12/(P22 + R) (y - h2), before any step."""
    plant = inline({"h1": "0.1 - sqrt(h1)", "h2": "sqrt(h1) - sqrt(h2)"}, "h2", initial={"h1": 0.1, "h2": 0.1})
    observer: Block = {"type": "ekf", "R": 0.01, "Q": {"h1": 1, "h2": 1}, "initial": {"h1": 0.2, "h2": 2}}
    observer["internal"] = {"P": [[1, 0.9], [0.9, 1]]}
    first = {"offset": 0.05} if period == 1.0 else {}
    measurement = {"sampling": {"period": period, **first}}
    found = simulated(plant, {"K": observer}, end=1, output_step=0.01, measurement=measurement).observers["K"]
    assert found.status == "undefined"
    assert (found.reason or "").startswith("sqrt of a negative number (h1 = -1.")


@pytest.mark.parametrize("missing", [None, 7])
def test_an_estimate_that_cannot_be_read(missing: int | None) -> None:
    run = prepare(experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 2}}, end=1, step=1e-2, output_step=0.1))
    raw = integrate(run, as_given(run))
    xhat = run.structure.estimates_along(run.grid, run.numbers.p, raw.rows[:, :, 0]).of(0).copy()
    if missing is None:
        xhat[:, 0] = 1e308  # finite numbers, whose sum is not
        assert of_estimate(run, raw, 0, xhat) == OK
        return
    xhat[missing:, 1] = np.nan
    verdict = of_estimate(run, raw, 0, xhat)
    assert verdict.status == "undefined"
    assert verdict.at == pytest.approx(0.7)
    assert verdict.reason is None
