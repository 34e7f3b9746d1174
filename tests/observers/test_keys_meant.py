"""Keys of an observer that are written as elsewhere, and what is offered in their place."""

from __future__ import annotations

import pytest
from examples import Block, chain, experiment

from hgorun.errors import ConfigError

PLANT = chain(2, "-x1 - x2")


@pytest.mark.parametrize("kind", ["ekf", "ukf", "hg_ekf", "aekf"])
@pytest.mark.parametrize("key", ["P0", "P"])
def test_an_initial_covariance_is_an_internal_state(kind: str, key: str) -> None:
    with pytest.raises(ConfigError, match=rf"unknown key '{key}'. What P begins at is `internal: {{P: ...}}`."):
        experiment(PLANT, {"o": {"type": kind, key: 1}})


def test_an_observer_without_covariance_is_not_told_of_one() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'P0'. Known here"):
        experiment(PLANT, {"o": {"type": "shgo", "theta": 2, "P0": 1}})


def test_another_key_of_a_filter_is_not_taken_for_a_covariance() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'thetta'. Did you mean `theta`\? Known here"):
        experiment(PLANT, {"o": {"type": "hg_ekf", "thetta": 1}})


@pytest.mark.parametrize(
    ("value", "words"), [(5, r"\[-5, 5\], found 5"), (-0.5, r"\[-0.5, 0.5\], found -0.5"), (0, r"\[-1, 1\], found 0")]
)
def test_a_bound_is_told_to_be_an_interval(value: float, words: str) -> None:
    block: Block = {"type": "shgo", "theta": 2, "saturation": {"x2": value}}
    with pytest.raises(ConfigError, match=rf"expected \[low, high\], such as {words}"):
        experiment(PLANT, {"o": block})
