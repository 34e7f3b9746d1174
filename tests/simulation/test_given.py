"""The error of runs with given steps or tolerances, estimated when it is asked for."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment

from hgorun import simulate

SHGO: Block = {"type": "shgo", "theta": 4, "initial": {"x1": 2, "x2": 1}}


@pytest.mark.parametrize("method", ["dopri5", "rodas5p"])
def test_tolerances_have_an_error_that_follows_them(method: str) -> None:
    errors = []
    for rtol in (1e-3, 1e-6):
        made = experiment(VAN_DER_POL, {"S": SHGO}, end=10, solver={"method": method, "rtol": rtol})
        found = simulate(made).integration_error
        assert found is not None
        errors.append(max(found.values()))
    assert 0 < errors[1] < 0.1 * errors[0]


def test_an_estimate_can_be_asked_for_in_another_process() -> None:
    """What has been pickled before it was asked for makes the run again, from the experiment."""
    result = simulate(experiment(VAN_DER_POL, {"S": SHGO}, end=10, step=0.02))
    assert result.integration is not None
    copied = pickle.loads(pickle.dumps(result.integration.error))
    assert copied().relative == result.integration_error


def test_what_is_stepped_at_the_samples_has_no_error_between_them() -> None:
    plant = {**VAN_DER_POL, "discretise": "euler"}
    made = experiment(plant, {"D": {"type": "deadbeat"}}, end=5, step=1, measurement={"sampling": {"period": 0.05}})
    assert simulate(made).integration_error == {"plant": 0.0, "D": 0.0}


def test_steps_at_the_limit_of_stability_are_compared_with_shorter_ones() -> None:
    """rk4 follows exp(-100 t) up to steps of 0.0278: longer ones say nothing of steps of 0.025."""
    made = experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 100}}, end=5, step=0.025)
    found = simulate(made).integration_error
    assert found is not None
    assert np.isfinite(found["plant"])
    assert found["plant"] < 1e-4
