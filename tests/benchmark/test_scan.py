"""What is tried of a knob."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.benchmark.scan import Scan
from hgorun.config.benchmark import Knob
from hgorun.config.tuning import Range


def knob(**more: object) -> Knob:
    return Knob.model_validate({"range": {"log": [1, 100]}, **more})


def test_values_all_over_the_range_in_units_of_the_rate() -> None:
    np.testing.assert_allclose(Scan(knob(), rate=2.0).coarse(3), [2, 20, 200])
    np.testing.assert_allclose(Scan(knob(rate=False), rate=2.0).coarse(3), [1, 10, 100])
    np.testing.assert_allclose(Scan(knob(range=Range(linear=(0, 4)))).coarse(3), [0, 2, 4])


def test_whole_numbers_are_not_tried_twice() -> None:
    values = Scan(knob(whole=True, range=Range(log=(3, 9)))).coarse(15)
    assert values.tolist() == [3, 4, 5, 6, 7, 8, 9]


@pytest.mark.parametrize("best", [0, 2, 4])
def test_around_the_best_between_its_neighbours(best: int) -> None:
    scan = Scan(knob())
    values = scan.coarse(5)
    scan.add(values, np.abs(np.arange(5.0) - best))
    fine = scan.around_best(7)
    assert fine.min() == pytest.approx(values[max(best - 1, 0)])
    assert fine.max() == pytest.approx(values[min(best + 1, 4)])
    assert values[best] in fine
    assert scan.is_end(scan.best) == (best in (0, 4))


def test_a_lost_estimate_is_never_the_best() -> None:
    scan = Scan(knob())
    scan.add(scan.coarse(3), np.array([np.inf, 5.0, np.inf]))
    assert scan.best == pytest.approx(10)
