"""``direct`` with poles on plants whose slopes are not 1."""

from __future__ import annotations

import numpy as np
import pytest
from examples import simulated

import hgorun

FALLING = {"states": ["a", "b"], "dynamics": {"a": "-b", "b": "-0.5*b - sin(a)"}, "output": "a"}


def test_poles_that_let_the_error_grow_are_refused_with_a_gain_that_does_not() -> None:
    """a' = -b: s^2 + 2 s - 1 has the root 0.414; l = (2, -1) gives (s + 1)^2."""
    plant = FALLING | {"initial": {"a": 1, "b": 0}}
    with pytest.raises(hgorun.ConfigError, match=r"here the slopes .* are 1, -1 near the start.*\[2, -1\]"):
        simulated(plant, {"D": {"type": "direct", "theta": 3}}, end=10, output_step=0.1, step=0.01)
    result = simulated(plant, {"D": {"type": "direct", "theta": 3, "l": [2, -1]}}, end=10, output_step=0.1, step=0.01)
    assert result.status == "ok"
    np.testing.assert_allclose(result.observers["D"].xhat[-1], result.x[-1], atol=1e-6)


def test_poles_that_are_stable_with_other_slopes_stay_allowed() -> None:
    plant = {"states": ["a", "b"], "dynamics": {"a": "3*b", "b": "-0.5*b - sin(a)"}, "output": "2*a"}
    plant |= {"initial": {"a": 1, "b": 0}}
    result = simulated(plant, {"D": {"type": "direct", "theta": 3}}, end=10, output_step=0.1, step=0.01)
    np.testing.assert_allclose(result.observers["D"].xhat[-1], result.x[-1], atol=1e-6)
