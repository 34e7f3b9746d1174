"""Claims that depend on what a publication leaves open: their numbers from the trajectories, with plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

import hgorun
from hgorun.reproduce.shipped import folder
from hgorun.study.measured import values_of
from hgorun.study.study import Study
from hgorun.study.verdict import Verdict, judge

THESIS = folder() / "robles2023" / "chapter3"


def study(name: str) -> tuple[Study, dict[str, hgorun.Result]]:
    """A file's study and the results of its runs."""
    found = hgorun.load_study(THESIS / f"{name}.yaml")
    return found, {run.name: hgorun.simulate(run.experiment) for run in found.runs.values()}


def verdict(found: Study, results: dict[str, hgorun.Result], claim: str) -> Verdict:
    number = [c.id for c in found.claims].index(claim)
    return judge(found.claims[number], values_of(found, number, results, {}, lambda quantity: np.nan))


def error(result: hgorun.Result, label: str, state: str, start: float, end: float) -> np.ndarray:
    j = result.states.index(state)
    inside = (result.time >= start - 1e-9) & (result.time <= end + 1e-9)
    return np.asarray((result.observers[label].xhat - result.x)[inside, j])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def high(values: np.ndarray, points: int) -> float:
    """Standard deviation about the centred mean over so many points, where there is one."""
    means = np.convolve(values, np.ones(points) / points, mode="valid")
    half = points // 2
    return float(np.std(values[half:-half] - means))


def ratio(one: float, other: float) -> float:
    return one / other


@pytest.mark.slow
def test_comparable_or_not_by_the_horizon() -> None:
    found, results = study("contois_te050")
    result = results["contois_te050"]
    one = verdict(found, results, "17b")
    assert one.verdict == "depends"
    for measured, end in zip(one.measured, (60, 20, 30, 40), strict=True):
        expected = ratio(*(rms(error(result, f"FHGO r={r}", "x1", 10, end)) for r in (3, 2)))
        assert measured.value == pytest.approx(expected, rel=1e-6)
        assert measured.verdict == ("confirmed" if 0.5 <= expected <= 2 else "refuted")
    assert [round(m.value, 2) for m in one.measured] == [0.29, 0.70, 0.65, 0.51]
    for claim, state, expected_verdict in (("19a", "x2", "confirmed"), ("19b", "x1", "refuted")):
        told = verdict(found, results, claim)
        by_hand = ratio(*(high(error(result, f"FHGO r={r}", state, 10, 60), 251) for r in (3, 2)))
        assert told.verdict == expected_verdict
        assert told.measured[0].value == pytest.approx(by_hand, rel=0.02)


@pytest.mark.slow
def test_the_caption_of_figure_3_11_decides_what_it_shows() -> None:
    found, results = study("contois_theta")
    one = verdict(found, results, "15b")
    assert one.verdict == "depends"
    for measured, theta in zip(one.measured, (2, 1), strict=True):
        run = results[f"theta{theta}"]
        expected = ratio(*(rms(error(run, f"FHGO r={r}", "x1", 10, 60)) for r in (3, 2)))
        assert measured.value == pytest.approx(expected, rel=1e-6)
    assert one.measured[0].value < 1 < one.measured[1].value
    due = verdict(found, results, "13b").measured[0].value
    ratios = [
        ratio(*(high(error(run, label, "x2", 10, 60), 125) for label in ("FHGO r=1", "SHGO")))
        for run in results.values()
    ]
    assert due == pytest.approx(max(ratios), rel=0.02)


def test_a_limit_is_not_refuted_by_a_run() -> None:
    lee = hgorun.load_study(folder() / "lee2016" / "stochastic_approximation.yaml")
    (claim,) = [claim for claim in lee.claims if claim.id == "23b"]
    assert claim.expected == "undecidable"
    assert judge(claim, [[35.8]]).verdict == "undecidable"
