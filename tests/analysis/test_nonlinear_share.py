"""How long a saturation was active, beside what the estimates show themselves."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, findings, inline, said

import hgorun

JERK: Block = inline({"a": "b", "b": "c", "c": "-1.2*c - 2*b - sin(a) + cos(1.5*t)"}, "a")
SKEW: Block = inline({"a": "b + a/3", "b": "c - b/7", "c": "-1.2*c - 2*b - sin(a) + cos(1.5*t)"}, "a")


@pytest.mark.parametrize(("theta", "alpha"), [(5.0, [2, 1, 1.1]), (3.7, [2, 1, 0.7]), (3.0, [2, 1, 1])])
def test_a_cascade_at_its_bound(theta: float, alpha: list[float]) -> None:
    """What is behind a bound is rebuilt from the estimate, which is exactly at the bound there."""
    block = {"type": "cascade", "theta": theta, "M": [10, 0.1], "alpha": alpha}
    run = experiment(JERK, {"C": block}, end=4, output_step=0.02, step=0.01, metrics={"window": [1, 4]})
    analysis = hgorun.analyze(run, findings("saturation"))
    third = analysis.result.observers["C"].xhat[50:, 2]
    share = float(np.mean(np.abs(third) == 0.1))
    assert 0.5 < share < 1
    assert said(analysis.observers["C"])["nonlinear_share"] == share


def test_a_cascade_whose_states_are_mapped() -> None:
    """There the second derivative of the output, not a state, is at its bound, but for rounding of the map."""
    block = {"type": "cascade", "theta": 3.7, "M": [10, 0.1]}
    run = experiment(SKEW, {"C": block}, end=4, output_step=0.02, step=0.01, metrics={"window": [1, 4]})
    analysis = hgorun.analyze(run, findings("saturation"))
    a, b, c = analysis.result.observers["C"].xhat[50:].T
    second = c - b / 7 + (b + a / 3) / 3
    share = float(np.mean(np.abs(np.abs(second) - 0.1) < 1e-12))
    assert 0.5 < share < 1
    assert said(analysis.observers["C"])["nonlinear_share"] == share
