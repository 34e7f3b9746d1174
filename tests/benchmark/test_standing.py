"""Standings of contestants, against what is worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hgorun.benchmark.benchmark import Entry
from hgorun.benchmark.standing import standings
from hgorun.benchmark.tables import markdown, table, text
from hgorun.benchmark.trial import Score


def score(total: Any, tried: Any = ((3.0, (1.0, 1.0)),)) -> Score:
    values = tuple(map(float, total))
    return Score(
        value=3.0,
        at_end=False,
        total=values,
        steady=values,
        peak=1.0,
        converged=0.5,
        operations=10,
        at_samples=0,
        nanoseconds=100.0,
        tried=tried,
    )


def entry(plant: str, label: str, total: Any, scenario: str = "calm") -> Entry:
    return Entry(plant, scenario, label, "group", score(total))


SPREAD = 1 + 0.1 * np.sin(np.arange(50))


def test_ratios_are_to_the_best_of_each_plant_and_averaged_geometrically() -> None:
    entries = [
        entry("p", "A", 2 * SPREAD),
        entry("p", "B", SPREAD),
        entry("q", "A", SPREAD),
        entry("q", "B", 8 * SPREAD),
    ]
    found = standings(entries)
    assert found["calm", "A"].ratio == pytest.approx(np.sqrt(2 * 1))
    assert found["calm", "B"].ratio == pytest.approx(np.sqrt(1 * 8))
    one = found["calm", "B"]  # both have met the same noise, so that their ratio is certain
    assert one.high - one.low < 1e-12
    assert (one.plants, one.lost) == (2, 0)


def test_an_interval_is_that_of_a_table_made_anew() -> None:
    random = np.random.default_rng(0)
    first, second = 1 + 0.3 * random.standard_normal((2, 400))
    found = standings([entry("p", "A", 3 * first), entry("p", "B", second)])["calm", "A"]
    half = 2.576 * 3 * 0.3 * np.sqrt(2 * 2 / 400)  # of two quotients of two independent means of about 1
    assert found.high - found.low == pytest.approx(2 * half, rel=0.15)
    assert found.low < 3 < found.high


def test_a_knob_that_luck_has_chosen_widens_the_interval() -> None:
    even, odd = np.tile([1.0, 1.2], 10), np.tile([1.2, 1.0], 10)  # as good as each other, on 20 seeds
    certain, doubtful = (2.0, tuple(even)), (4.0, tuple(1.05 * odd))
    apart = (4.0, tuple(2 * odd))

    def found(tried: Any) -> Any:
        entries = [Entry("p", "calm", "A", "group", score(SPREAD, tried)), entry("p", "B", SPREAD / 2)]
        return standings(entries)["calm", "A"]

    assert found((certain, apart)).high == pytest.approx(2)
    assert 2 < found((certain, doubtful)).high <= 2.1 + 1e-9
    assert found((certain, doubtful)).low == pytest.approx(4 / found((certain, doubtful)).high)
    assert found((certain, (8.0, (np.inf, *even[1:])))).high == pytest.approx(2)  # who loses the estimate is no choice


def test_who_loses_most_runs_is_out_and_who_is_refused_has_no_ratio() -> None:
    lost = np.where(np.arange(50) < 30, np.inf, 1.0)
    few = np.where(np.arange(50) < 3, np.inf, 1.0)
    refused = Entry("p", "calm", "C", "group", refused="needs samples")
    found = standings([entry("p", "A", lost), entry("p", "B", few), refused])
    assert (found["calm", "A"].plants, found["calm", "A"].lost) == (0, 30)
    assert (found["calm", "B"].plants, found["calm", "B"].lost) == (1, 3)
    assert found["calm", "B"].ratio == pytest.approx(1)
    assert np.isnan(found["calm", "C"].ratio)


def test_tables_say_all_of_it() -> None:
    entries = [
        entry("p", "A", 2 * SPREAD),
        entry("p", "B", SPREAD),
        Entry("p", "calm", "C", "group", refused="too, bad"),
    ]
    found = standings(entries)
    assert "2.00 (1)" in text(found, ["calm"])
    assert "| A | 2.00 [2.00, 2.00] (1) |" in markdown(found, ["calm"])
    assert "| C | - |" in markdown(found, ["calm"])
    assert "- `deadbeat`: no knob" in markdown(found, ["calm"], {"deadbeat": "no knob"})
    lines = table(entries).splitlines()
    assert lines[0].startswith("plant,scenario,observer,group,knob")
    assert lines[3].endswith('"too, bad"')
