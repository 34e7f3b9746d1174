"""What is tried of a knob: the range, and the search around the best."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from hgorun.benchmark.scan import Scan, Search
from hgorun.config.benchmark import Knob
from hgorun.config.tuning import Range

Floats = NDArray[np.float64]


def knob(**more: object) -> Knob:
    return Knob.model_validate({"range": {"log": [1, 100]}, **more})


def errors(of: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
    """Those of one seed."""
    return lambda values: of(values)[:, None]


def test_values_all_over_the_range_in_units_of_the_rate() -> None:
    for scan, expected in (
        (Scan(knob(), rate=2.0), [2, 20, 200]),
        (Scan(knob(rate=False), rate=2.0), [1, 10, 100]),
        (Scan(knob(range=Range(linear=(0, 4)))), [0, 2, 4]),
    ):
        np.testing.assert_allclose(scan.at(scan.coarse(3)), expected)


def test_whole_numbers_are_not_tried_twice() -> None:
    scan = Scan(knob(whole=True, range=Range(log=(3, 9))))
    assert scan.at(scan.coarse(15)).tolist() == [3, 4, 5, 6, 7, 8, 9]


@pytest.mark.parametrize("best", np.geomspace(2, 90, 7))
def test_the_best_is_found_to_an_eighth_of_the_spacing(best: float) -> None:
    scan, count = Scan(knob()), 9
    bowl = errors(lambda values: np.log(values / best) ** 2)
    places = scan.coarse(count)
    start = places[np.argmin(bowl(scan.at(places)))]
    search = Search(scan, bowl)
    found = search.around(float(start), 1 / (count - 1), 7)
    assert abs(np.log(found / best)) <= np.log(100) / (count - 1) / 8
    assert len(search.tried) <= 7


def test_between_values_it_goes_to_the_bottom_of_a_parabola() -> None:
    """So that what is found is that of a smooth curve, and not that of the values which happened to be tried."""
    found = []
    for start in (0.4, 0.45, 0.5):  # other values each
        search = Search(
            Scan(knob()), errors(lambda values: 1 + np.log(values / 9) ** 2 + 0.2 * np.log(values / 9) ** 3)
        )
        found.append(search.around(start, 1 / 8, 10))
    np.testing.assert_allclose(found, 9, rtol=2e-3)


def test_it_walks_where_the_start_was_a_mistake() -> None:
    search = Search(Scan(knob()), errors(lambda values: np.log(values / 40) ** 2))
    spacing = 1 / 8
    found = search.around(0.5, spacing, 9)  # 10, and 40 is 2.4 spacings away
    assert abs(np.log(found / 40)) < np.log(100) * spacing / 4


def test_whole_numbers_are_searched_without_repetition() -> None:
    asked: list[float] = []

    def of(values: Floats) -> Floats:
        asked.extend(values.tolist())
        return np.abs(values - 17)

    scan = Scan(knob(whole=True, range=Range(log=(5, 41))))
    assert Search(scan, errors(of)).around(0.5, 1 / 8, 7) == 17
    assert len(asked) == len(set(asked)) <= 7
    assert all(value == round(value) for value in asked)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 100.0)])
def test_an_end_of_the_range_is_told(start: float, end: float) -> None:
    scan = Scan(knob())
    found = Search(scan, errors(lambda values: np.abs(values - end))).around(start, 1 / 8, 7)
    assert found == end
    assert scan.is_end(found)
    assert not scan.is_end(10.0)


def test_a_lost_estimate_is_never_the_best() -> None:
    def of(values: Floats) -> Floats:
        good = np.where(values > 10, np.inf, 1 / values)
        return np.stack([good, np.ones_like(good)], axis=1)  # the other seed keeps it

    found = Search(Scan(knob()), of).around(0.4, 1 / 8, 7)
    assert found <= 10
