"""Gains that are given as they are: where the error would grow with them, this is told before the run."""

from __future__ import annotations

import re

import pytest
from examples import Block, chain, experiment

from hgorun.simulation.preparation.scheduling import remarks

CASES: list[tuple[int, Block, bool]] = [
    # by the criterion of Routh and Hurwitz: s^2 + a s + b needs a, b > 0; s^3 + a s^2 + b s + c also a b > c
    (2, {"type": "shgo", "theta": 2, "gains": [2, 1]}, False),
    (2, {"type": "shgo", "theta": 2, "gains": [2, -1]}, True),
    (2, {"type": "shgo", "theta": 2, "gains": [0, 0]}, True),
    (2, {"type": "shgo", "theta": 2, "gains": [0, 1]}, True),
    (3, {"type": "shgo", "theta": 2, "gains": [2, 3, 5.9]}, False),
    (3, {"type": "shgo", "theta": 2, "gains": [2, 3, 6.1]}, True),
    (3, {"type": "shgo", "theta": 2, "poles": -1}, False),
    (2, {"type": "integral", "theta": 2, "r": 1, "gains": [2, 3, 6.1]}, True),
    (2, {"type": "fhgo2", "theta": 2, "r": 1, "gains": [2, 3, 5.9]}, False),
    (2, {"type": "extended", "theta": 2, "gains": [2, 3, 6.1]}, True),
    (2, {"type": "shgo", "theta": 2, "extend": 1, "gains": [2, 3, 6.1]}, True),
    (2, {"type": "shgo", "theta": 2, "extend": 1, "gains": [2, 3, 5.9]}, False),
    (2, {"type": "eso", "omega_o": 2, "gains": [2, 3, 6.1]}, True),
    (2, {"type": "switched", "theta_1": 4, "theta_2": 2, "delta": 0.1, "gains": [2, -1]}, True),
    # s (s + d) + c of the cascade for one state; for two s (s + d_2) (s (s + d_1) + c_1) + c_2
    (2, {"type": "treangle", "theta": 2, "gains": [2, 2, 2, 1]}, False),
    (2, {"type": "treangle", "theta": 2, "gains": [2, 2, 2, -1]}, True),
    # s (s + k_11) + k_12
    (2, {"type": "low_power", "theta": 2, "gains": [2, 1]}, False),
    (2, {"type": "low_power", "theta": 2, "gains": [-2, 1]}, True),
    (2, {"type": "direct", "theta": 2, "mu": 0, "l": [2, 1]}, False),
    (2, {"type": "direct", "theta": 2, "mu": 0, "l": [2, -1]}, True),
]


@pytest.mark.parametrize(("n", "block", "told"), CASES)
def test_gains_with_which_the_error_grows_are_told(n: int, block: Block, told: bool) -> None:
    found = [one for one in remarks(experiment(chain(n), {"O": block})) if "the error grows" in one]
    assert len(found) == told
    key = "l" if "l" in block else "gains"
    assert all(re.match(rf"test:\d+: observers.O.{key}: with these gains", one) for one in found)


def test_the_eigenvalue_is_that_of_the_polynomial() -> None:
    (told,) = remarks(experiment(chain(2), {"O": {"type": "shgo", "theta": 3, "gains": [-3, 2]}}))  # (s - 1) (s - 2)
    assert "it has the eigenvalue 2 at theta = 1" in told
    (told,) = remarks(experiment(chain(2), {"O": {"type": "shgo", "theta": 3, "gains": [0, 4]}}))  # s = +-2 j
    assert "it has the eigenvalue 0+2j at theta = 1" in told or "it has the eigenvalue 0-2j" in told
