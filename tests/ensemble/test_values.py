"""Values of axes: the same whatever else is asked for, and distributed as they should be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtri

from hgorun.config.sweeps import LinearAxis, ListAxis, LogAxis, NormalAxis, SeedAxis, UniformAxis
from hgorun.ensemble.members.quantile import normal_quantile
from hgorun.ensemble.members.values import Values, values_of


def every(values: Values) -> np.ndarray:
    return values.at(np.arange(values.size))


def test_ranges_have_their_ends_and_equal_steps_or_ratios() -> None:
    linear = every(values_of(LinearAxis(linear=(0.1, 0.7, 7)), "a", 0))
    assert (linear[0], linear[-1]) == (0.1, 0.7)
    assert np.diff(linear) == pytest.approx(np.full(6, 0.1))
    log = every(values_of(LogAxis(log=(2, 20, 10)), "a", 0))
    assert (log[0], log[-1]) == (2, 20)
    assert log == pytest.approx(np.geomspace(2, 20, 10), rel=1e-14)
    assert every(values_of(LogAxis(log=(3, 5, 1)), "a", 0)).tolist() == [3]


def test_lists_keep_what_their_values_are() -> None:
    assert every(values_of(ListAxis(values=(1, 2)), "a", 0)).dtype == np.int64
    assert every(values_of(ListAxis(values=(1, 2.5)), "a", 0)).tolist() == [1, 2.5]
    assert every(values_of(ListAxis(values=("rk4", 2, True)), "a", 0)).tolist() == ["rk4", 2, True]
    assert every(values_of(ListAxis(values=(2**64, 1)), "a", 0)).tolist() == [2**64, 1]


def test_seeds_begin_with_that_of_the_base() -> None:
    assert every(values_of(SeedAxis(count=3), "seed", 7)).tolist() == [7, 8, 9]


@pytest.mark.parametrize("axis", [NormalAxis(normal=(3, 0.5), draws=5000), UniformAxis(uniform=(-1, 2), draws=5000)])
def test_draws_do_not_depend_on_how_many_there_are(axis: NormalAxis | UniformAxis) -> None:
    values = values_of(axis, "a.b", 4)
    draws = every(values)
    assert values.at(np.array([4999, 1024, 0])).tolist() == draws[[4999, 1024, 0]].tolist()
    fewer = values_of(axis.model_copy(update={"draws": 10}), "a.b", 4)
    assert every(fewer).tolist() == draws[:10].tolist()
    assert np.unique(draws).size == draws.size
    assert values_of(axis, "a.b", 5).at(np.arange(3)).tolist() != draws[:3].tolist()
    assert values_of(axis, "a.c", 4).at(np.arange(3)).tolist() != draws[:3].tolist()


def test_draws_have_their_distribution() -> None:
    normal = every(values_of(NormalAxis(normal=(3, 0.5), draws=20_000), "a", 0))
    assert np.mean(normal) == pytest.approx(3, abs=5 * 0.5 / 141)
    assert np.std(normal) == pytest.approx(0.5, rel=0.03)
    uniform = every(values_of(UniformAxis(uniform=(-1, 2), draws=20_000), "a", 0))
    assert -1 <= uniform.min() < -0.99 < 1.99 < uniform.max() < 2
    assert np.mean(uniform) == pytest.approx(0.5, abs=0.03)


def test_the_quantile_is_that_of_the_normal_distribution() -> None:
    p = np.concatenate([np.linspace(1e-6, 1 - 1e-6, 2001), 10.0 ** -np.arange(1, 300)])
    assert normal_quantile(p) == pytest.approx(ndtri(p), rel=2e-15, abs=2e-15)
