"""Gains that were found at an end of their range, and the wider range that is advised."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun import load
from hgorun.config.tuning import Range
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.tuning.gain import Gain, at_an_end

CONFIG = """\
time: {end: 4, output_step: 0.02}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {SHGO: {type: shgo, theta: 2, initial: {x1: 0, x2: 2}}}
"""
LIE_BEYOND = ": better values may lie beyond it"


@pytest.fixture
def base(tmp_path: Path) -> Experiment:
    path = tmp_path / "c.yaml"
    path.write_text(CONFIG)
    return load(path)


@pytest.mark.parametrize(
    ("given", "value", "end", "wider"),
    [
        # two hundredths in the scale in which it is sought: of [1, 100] up to 100^0.02 = 1.096, and from 91.2 on
        (Range(log=(1, 100)), 1.09, "lower end of its range [1, 100]", "{log: [0.1, 100]}"),
        (Range(log=(1, 100)), 91.5, "upper end of its range [1, 100]", "{log: [1, 1000]}"),
        (Range(linear=(1, 101)), 99.5, "upper end of its range [1, 101]", "{linear: [1, 201]}"),
        (Range(linear=(1, 101)), 2.9, "lower end of its range [1, 101]", "{linear: [0.1, 101]}"),
        # no farther than numbers reach
        (Range(log=(1e-300, 1e8)), 1e8, "upper end of its range [1e-300, 1e+08]", "{log: [1e-300, 1.25893e+08]}"),
    ],
)
def test_the_range_advised_is_wider_at_the_end(
    base: Experiment, given: Range, value: float, end: str, wider: str
) -> None:
    found = at_an_end(base, Gain("observers.SHGO.theta", given, "observers.*.theta"), value)
    assert found == f"observers.SHGO.theta = {value:g} is at the {end}{LIE_BEYOND}; write observers.*.theta: {wider}"


@pytest.mark.parametrize(
    ("given", "value"),
    [(Range(log=(1, 100)), 1.1), (Range(log=(1, 100)), 91), (Range(linear=(1, 101)), 3.1)],
)
def test_what_is_farther_from_an_end_is_not_told(base: Experiment, given: Range, value: float) -> None:
    assert at_an_end(base, Gain("observers.SHGO.theta", given, "observers.SHGO.theta"), value) is None


def test_a_range_that_is_refused_is_not_advised(base: Experiment) -> None:
    """theta has to be positive."""
    gain = Gain("observers.SHGO.theta", Range(linear=(1e-9, 1e-8)), "observers.SHGO.theta")
    assert at_an_end(base, gain, 1e-9) == (
        f"observers.SHGO.theta = 1e-09 is at the lower end of its range [1e-09, 1e-08]{LIE_BEYOND}"
        "; write observers.SHGO.theta: {linear: [1e-10, 1e-08]}"
    )
    gain = Gain("metrics.average", Range(linear=(0, 1)), "metrics.average")
    assert at_an_end(base, gain, 0) == f"metrics.average = 0 is at the lower end of its range [0, 1]{LIE_BEYOND}"


@pytest.mark.parametrize(
    ("ends", "end", "wider"),
    [
        ((-3, -1), "upper", "{linear: [-3, -0.1]}"),
        ((-3, -1), "lower", "{linear: [-5, -1]}"),
        ((-1, 1), "lower", "{linear: [-3, 1]}"),
        ((4, 5), "lower", "{linear: [3, 5]}"),
        ((0, 1), "lower", "{linear: [-1, 1]}"),
    ],
)
def test_a_wider_range_stays_on_its_side_of_zero(ends: tuple[float, float], end: str, wider: str) -> None:
    assert str(Range(linear=ends).beyond(end, 1.0)) == wider
