"""The super-twisting observer: its Euler loop, finite time in spite of a disturbance, and its class."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, simulated

from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

PLANT = inline({"x1": "x2", "x2": "-x1 - 0.5*x2 + d"}, "x1", initial={"x1": 1, "x2": 0},
               inputs={"d": "0"}, disturbance={"x2": "0.4*sin(2*t)"})  # fmt: skip
EULER: Block = {"method": "euler", "step": 1e-3}


@pytest.mark.parametrize("sampled", [False, True])
def test_a_run_is_the_euler_loop(sampled: bool) -> None:
    """Continuous, and with samples at the steps."""
    measurement: Block = {"sampling": {"period": 1e-3}} if sampled else {}
    block = {"type": "super_twisting", "f": 2}
    run = simulated(PLANT, {"S": block}, end=0.3, output_step=1e-3, solver=EULER, measurement=measurement)
    xhat, h = np.zeros(2), 1e-3
    for k in range(300):
        np.testing.assert_allclose(run.observers["S"].xhat[k], xhat, rtol=1e-9, atol=1e-9)
        e = xhat[0] - run.x[k, 0]
        first = xhat[1] - 1.5 * np.sqrt(2) * np.sqrt(abs(e)) * np.sign(e)
        xhat = xhat + h * np.array([first, -xhat[0] - 0.5 * xhat[1] - 2.2 * np.sign(e)])


def test_right_after_a_finite_time_whatever_the_disturbance() -> None:
    """But for the chatter of the step, while a linear correction keeps an error."""
    blocks: dict[str, Block] = {"S": {"type": "super_twisting", "f": 2}, "H": {"type": "shgo", "theta": 3}}
    run = simulated(PLANT, blocks, end=10, output_step=0.01, solver=EULER)
    errors = {label: np.abs(one.xhat - run.x)[500:].max(axis=0) for label, one in run.observers.items()}
    assert errors["S"][0] < 1e-5
    assert errors["S"][1] < 1e-2
    assert errors["H"][1] > 0.1


def test_other_coordinates_are_those_of_the_chain() -> None:
    """a = x1, b = x2 - x1, corrected through the inverse of the map: the same plant, the same estimate."""
    other = inline({"a": "a + b", "b": "-2.5*a - 1.5*b"}, "a", initial={"a": 1, "b": -1})
    straight = inline({"x1": "x2", "x2": "-x1 - 0.5*x2"}, "x1", initial={"x1": 1, "x2": 0})
    block = {"type": "super_twisting", "f": 2, "map": "derivatives"}
    z = simulated(straight, {"S": block}, end=0.3, solver=EULER).observers["S"].xhat
    ab = simulated(other, {"S": block}, end=0.3, solver=EULER).observers["S"].xhat
    np.testing.assert_allclose(np.column_stack([ab[:, 0], ab.sum(axis=1)]), z, rtol=1e-9)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="for chains of two states; found 3"):
        prepare(experiment(chain(3), {"S": {"type": "super_twisting", "f": 1}}, solver=EULER))
    with pytest.raises(ConfigError, match="has no limit as steps get shorter"):
        prepare(experiment(PLANT, {"S": {"type": "super_twisting", "f": 1}}))
    with pytest.raises(ConfigError, match="takes outputs without delay"):
        prepare(experiment(PLANT, {"S": {"type": "super_twisting", "f": 1}}, solver=EULER, measurement={"delay": 0.1}))
    two = inline({"a": "b", "b": "-a", "c": "d", "d": "-c"}, ["a", "c"])
    with pytest.raises(ConfigError, match="a number for each output: a, c"):
        prepare(experiment(two, {"S": {"type": "super_twisting", "f": {"a": 1}}}, solver=EULER))
    run = prepare(experiment(two, {"S": {"type": "super_twisting", "f": {"c": 1, "a": 2}}}, solver=EULER))
    assert run.observers[0].design["second"].tolist() == [2.2, 1.1]
