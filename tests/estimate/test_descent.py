"""The search for three gains or more follows valleys that are narrow, and those that an end of a range cuts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares, nnls

from hgorun.config.tuning import Range
from hgorun.estimate.gains import tuning
from hgorun.estimate.gains.goal import Goal
from hgorun.estimate.gains.tuning import Trials
from hgorun.symbolic.evaluate import Floats


class Known(Trials):
    """Trials whose errors are a function of the place in the unit cube."""

    def __init__(self, of: Callable[[Floats], Floats], start: Floats, budget: int) -> None:
        super().__init__([], Goal("holdout_rmse", "o", "y"), {"abc"[k]: Range(linear=(0, 1)) for k in range(3)}, budget)
        self.of = of
        self.value(start)

    def errors(self, u: Floats) -> Floats | None:
        if len(self.tried) >= self.budget:
            return None
        found = self.of(u)
        self.tried.append((tuple(u.tolist()), float(np.sqrt(found @ found))))
        return found


def test_a_valley_that_is_narrow_beside_the_range() -> None:
    """A decaying swing in noise: over 200 s its frequency is known to a thousandth of what one over its length is."""
    t = np.linspace(0, 200, 2001)
    noise = 0.3 * np.random.default_rng(5).standard_normal(t.size)

    def errors(u: Floats) -> Floats:
        def swing(frequency: float, decay: float, size: float) -> Floats:
            return np.asarray(2 * size * np.exp(-0.1 * decay * t) * np.cos((4 + 4 * frequency) * t))

        return swing(0.5, 0.3, 0.5) + noise - swing(*u)

    start = np.array([0.502, 0.6, 0.9])
    best = least_squares(errors, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    trials = Known(errors, start, 40)
    tuning._descend(trials)
    assert trials.least**2 - 2 * best.cost < 1e-2 * 0.3**2  # of the square of a standard error
    np.testing.assert_allclose(trials.first, best.x, atol=1e-4)


@pytest.mark.parametrize("lowest", [0, 1, 2])
def test_at_an_end_of_a_range_the_others_make_up(lowest: int) -> None:
    """Linear errors whose least lies where one gain is at 0, at a place that all of them have to reach together."""
    rng = np.random.default_rng(11)
    base = rng.standard_normal((60, 1))
    slope = np.roll(base + 0.02 * rng.standard_normal((60, 3)), lowest, axis=1)
    wanted = slope @ np.roll([-0.3, 0.8, 0.2], lowest) + 0.01 * rng.standard_normal(60)
    best, least = nnls(slope, wanted)
    assert np.all(best < 1)
    assert np.count_nonzero(best == 0) >= 1
    trials = Known(lambda u: slope @ u - wanted, np.array([0.7, 0.7, 0.7]), 30)
    tuning._descend(trials)
    assert trials.least == pytest.approx(least, rel=1e-3)
    np.testing.assert_allclose(trials.first, best, atol=0.02)
