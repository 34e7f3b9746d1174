"""Outliers: how often, how large, and the same draws alone and in an ensemble."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.noise.base import Draws, Spectrum
from hgorun.noise.outliers import Outliers
from hgorun.noise.streams import Streams

SEEDS = np.arange(40)


@pytest.mark.parametrize("probability", [0.0, 0.02, 0.3, 1.0])
def test_each_sign_has_half_of_the_probability(probability: float) -> None:
    count = 200_000
    draws = Outliers(type="outliers", size=3, probability=probability).draw(np.random.default_rng(1), count)
    assert set(draws.tolist()) <= {-3.0, 0.0, 3.0}
    spread = 4 * np.sqrt(0.25 * count)  # four standard deviations of a count, at most
    for sign in (-3.0, 3.0):
        assert abs(np.sum(draws == sign) - 0.5 * probability * count) <= spread
    assert np.sum(draws != 0) == pytest.approx(probability * count, abs=spread)


def test_a_longer_run_begins_with_the_draws_of_a_shorter_one() -> None:
    block = Outliers(type="outliers", size=2, probability=0.5)
    short, long = (block.draw(np.random.default_rng(5), count) for count in (50, 500))
    assert np.array_equal(long[:50], short)


def test_many_generators_draw_what_each_draws_alone() -> None:
    block, streams = Outliers(type="outliers", size=1.5, probability=0.25), Streams(SEEDS, (0, 3))
    many = block.draw_many(streams, 300)
    alone = [block.draw(streams.generator(i), 300) for i in range(len(SEEDS))]
    assert np.array_equal(many, alone)


def test_what_linear_theory_is_told() -> None:
    block = Outliers(type="outliers", size=2, probability=0.1, hold=0.5)
    assert block.spectrum() == Spectrum(draws=(Draws(0.0, 0.4, 0.5),))
    draws = block.draw(np.random.default_rng(2), 200_000)
    assert np.mean(draws**2) == pytest.approx(0.4, rel=0.03)
