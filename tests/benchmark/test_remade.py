"""Intervals of the benchmark: how often a table that is made anew lies in them; and the parabolas below them."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.benchmark.intervals import chosen_anew, remade, resampled
from hgorun.benchmark.parabolas import Floats, vertices
from hgorun.benchmark.scan import Scan, Search
from hgorun.benchmark.trial import Score
from hgorun.config.benchmark import Knob

_KNOB = Knob.model_validate({"range": {"log": [1, 100]}})


def score(total: Floats, tried: dict[float, Floats]) -> Score:
    return Score(
        value=1.0,
        at_end=False,
        total=tuple(total.tolist()),
        steady=(1.0,),
        peak=1.0,
        converged=1.0,
        operations=1,
        at_samples=0,
        nanoseconds=1.0,
        tried=tuple((value, tuple(errors.tolist())) for value, errors in tried.items()),
    )


def made(random: np.random.Generator, noise: float) -> Score:
    """Tuned and scored: errors are quadratic in log theta, best at a theta that differs from seed to seed."""

    def errors_of(values: Floats) -> Floats:
        return np.array(1 + np.log(values[:, None] / best) ** 2)

    best = 12 * np.exp(noise * random.standard_normal(20))
    search = Search(Scan(_KNOB), errors_of)
    value = search.around(random.choice([0.5, 0.625]), 1 / 8, 10)
    best = 12 * np.exp(noise * random.standard_normal(50))
    return score(errors_of(np.array([value]))[0], search.tried)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.3, 0.02])
def test_tables_made_anew_lie_in_the_interval(noise: float) -> None:
    """With noise that decides the error, and with noise that hardly matters beside what tuning leaves."""
    random, inside = np.random.default_rng(3), []
    for _ in range(60):
        low, high = remade(resampled(made(random, noise)))
        inside += [low <= np.mean(made(random, noise).total) <= high for _ in range(10)]
    assert 0.96 < np.mean(inside) <= 1


def test_a_knob_that_is_uncertain_costs_what_the_curve_says() -> None:
    """Seeds that disagree by a factor of e^(+-0.5): the knob of 20 of them is uncertain by 0.5/sqrt(20)."""
    values = np.exp(np.linspace(-0.5, 0.5, 5))
    best = np.exp(np.tile([-0.5, 0.5], 10))
    tried = {float(value): 1 + np.log(value / best) ** 2 for value in values}
    factors = chosen_anew(score(np.ones(2), tried))
    assert factors[0] == 1
    assert np.mean(factors[1:] - 1) == pytest.approx(0.25 / 20 / 1.25, rel=0.1)


def test_vertices_of_parabolas() -> None:
    values = np.array([1.0, 2.0, 5.0, 9.0])
    centres = np.array([2.5, 4.0, 6.0])
    errors = 3 + 2 * np.log(values[:, None] / centres) ** 2
    found, then = vertices(values, errors, 1 + np.log(values / 4) ** 2)
    np.testing.assert_allclose(found, centres, rtol=1e-12)
    np.testing.assert_allclose(then, 1 + np.log(centres / 4) ** 2, rtol=1e-12)


@pytest.mark.parametrize(
    ("errors", "least"),
    [([1.0, 2, 3], 0.0), ([3.0, 2, 1], 2.0), ([3.0, 1, np.inf], 1.0), ([np.inf, 2, 1], 2.0), ([1.0, 1, 1], 0.0)],
)
def test_where_there_is_no_parabola_the_least_value_is_taken(errors: list[float], least: float) -> None:
    found, then = vertices(np.arange(3.0), np.array(errors)[:, None])
    assert (found[0], then[0]) == (least, min(errors))
