"""Verdicts on claims: by a number, and by the interval of the mean over an ensemble."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from hgorun.config.models import Claim
from hgorun.study.verdict import CONFIDENCE, judge, number_text


def claim(**relation: Any) -> Claim:
    return Claim.model_validate({"id": "1", "claim": "Small.", "value": "rmse('a/b', x1)", **relation})


@pytest.mark.parametrize(
    ("relation", "value", "verdict"),
    [
        ({"below": 1}, 0.5, "confirmed"),
        ({"below": 1}, 1.0, "refuted"),
        ({"above": 1}, 1.0, "refuted"),
        ({"above": 1}, 1.5, "confirmed"),
        ({"between": [1, 2]}, 1.0, "confirmed"),
        ({"between": [1, 2]}, 2.0, "confirmed"),
        ({"between": [1, 2]}, 2.1, "refuted"),
        ({"below": 1}, math.nan, "undecided"),
        ({"below": 1}, math.inf, "refuted"),
    ],
)
def test_of_one_number(relation: dict[str, Any], value: float, verdict: str) -> None:
    found = judge(claim(**relation), [value])
    assert (found.verdict, found.interval, found.members) == (verdict, None, 1)
    assert found.as_expected == (verdict == "confirmed")


VALUES = np.random.default_rng(4).normal(1.0, 0.3, 20)
LOW, HIGH = student.interval(CONFIDENCE, 19, VALUES.mean(), VALUES.std(ddof=1) / np.sqrt(20))


@pytest.mark.parametrize(
    ("relation", "verdict"),
    [
        ({"below": HIGH + 1e-9}, "confirmed"),
        ({"below": HIGH - 1e-9}, "undecided"),
        ({"below": LOW + 1e-9}, "undecided"),
        ({"below": LOW - 1e-9}, "refuted"),
        ({"above": LOW - 1e-9}, "confirmed"),
        ({"above": LOW + 1e-9}, "undecided"),
        ({"above": HIGH + 1e-9}, "refuted"),
        ({"between": [LOW - 1e-9, HIGH + 1e-9]}, "confirmed"),
        ({"between": [LOW + 1e-9, HIGH + 1e-9]}, "undecided"),
        ({"between": [HIGH + 1e-9, 9]}, "refuted"),
        ({"between": [-9, LOW - 1e-9]}, "refuted"),
    ],
)
def test_of_an_ensemble_by_its_confidence_interval(relation: dict[str, Any], verdict: str) -> None:
    found = judge(claim(**relation), VALUES.tolist())
    assert found.interval == pytest.approx((LOW, HIGH), rel=1e-12)
    assert (found.verdict, found.members) == (verdict, 20)


def test_an_ensemble_with_one_that_diverged_decides_nothing() -> None:
    with np.errstate(invalid="ignore"):
        assert judge(claim(below=1), [0.1, 0.2, math.nan]).verdict == "undecided"


def test_in_words() -> None:
    assert number_text(judge(claim(below=0.2), [0.0123])) == "0.0123 (< 0.2 is claimed)"
    assert number_text(judge(claim(above=2), [3])) == "3 (> 2 is claimed)"
    text = number_text(judge(claim(between=[1, 2]), [1.0, 1.2, 1.4]))
    assert text.startswith("1.2 [")
    assert text.endswith("] of 3 (1 to 2 is claimed)")


def test_as_json_holds_it() -> None:
    found = judge(claim(below=1), [math.inf]).as_json()
    assert (found["value"], found["relation"], found["threshold"]) == ("inf", "<", 1)
    assert judge(claim(between=[1, 2]), [1.5]).as_json()["threshold"] == [1, 2]
    assert judge(claim(above=1), [1.5]).as_json()["relation"] == ">"
