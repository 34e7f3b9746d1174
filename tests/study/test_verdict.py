"""Verdicts on claims: by a number, and by the interval of the mean over an ensemble."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from hgorun.config.study import Claim
from hgorun.study.verdict import CONFIDENCE, judge


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
        ({"below": 1}, math.nan, "undecidable"),
        ({"below": 1}, math.inf, "refuted"),
    ],
)
def test_of_one_number(relation: dict[str, Any], value: float, verdict: str) -> None:
    found = judge(claim(**relation), [[value]])
    assert [(found.verdict, None, 1)] == [(one.verdict, one.interval, one.members) for one in found.measured]
    assert found.verdict == verdict
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
    found = judge(claim(**relation), [VALUES.tolist()])
    assert found.measured[0].interval == pytest.approx((LOW, HIGH), rel=1e-12)
    assert (found.verdict, found.measured[0].members) == (verdict, 20)


def test_an_ensemble_with_a_missing_number_decides_nothing() -> None:
    with np.errstate(invalid="ignore"):
        found = judge(claim(below=1), [[0.1, 0.2, math.nan]])
    assert found.verdict == "undecidable"
    assert "1 of its 3 numbers are missing" in found.reason
    assert judge(claim(above=1), [[0.1, 0.2, math.inf]]).verdict == "undecidable"
    assert judge(claim(above=1), [[0.1, 0.2, -math.inf]]).verdict == "undecidable"
    with np.errstate(invalid="ignore"):
        assert judge(claim(below=1), [[0.1, math.inf, -math.inf]]).verdict == "undecidable"
    assert judge(claim(above=1), [[math.inf] * 3]).verdict == "confirmed"


def test_the_mean_of_an_ensemble_with_an_infinite_error_is_not_below_a_number() -> None:
    for relation in ({"below": 1}, {"between": [0, 1]}):
        for values in ([0.1, 0.2, math.inf], [math.inf] * 3):
            found = judge(claim(**relation), [values])
            assert (found.verdict, found.reason, found.measured[0].interval) == ("refuted", "", None)
    assert judge(claim(below=1), [[0.1, math.inf]]).texts[0] == "inf of 2 (< 1 is claimed)"


def test_in_words() -> None:
    assert judge(claim(below=0.2), [[0.0123]]).texts[0] == "0.0123 (< 0.2 is claimed)"
    assert judge(claim(above=2), [[3]]).texts[0] == "3 (> 2 is claimed)"
    text = judge(claim(between=[1, 2]), [[1.0, 1.2, 1.4]]).texts[0]
    assert text.startswith("1.2 [")
    assert text.endswith("] of 3 (1 to 2 is claimed)")


def test_as_json_holds_it() -> None:
    found = judge(claim(below=1), [[math.inf]]).as_json()
    assert (found["value"], found["relation"], found["threshold"]) == ("inf", "<", 1)
    assert judge(claim(between=[1, 2]), [[1.5]]).as_json()["threshold"] == [1, 2]
    assert judge(claim(above=1), [[1.5]]).as_json()["relation"] == ">"


OTHER = {"value": "rmse('a/b', x1, 0, 9)", "below": 1, "note": "on [0, 9]"}


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ([[0.5], [0.5], [0.7]], "confirmed"),
        ([[1.5], [1.5], [1.7]], "refuted"),
        ([[0.5], [1.5], [0.7]], "depends"),
        ([[1.5], [0.5], [0.7]], "depends"),
        ([[0.5], [math.nan], [0.7]], "undecidable"),
        ([[0.5], [math.nan], [1.7]], "depends"),
    ],
)
def test_with_alternatives_by_whether_they_agree(values: list[list[float]], verdict: str) -> None:
    found = judge(claim(below=1, alternatives=[OTHER, OTHER], expect="depends"), values)
    assert found.verdict == verdict
    assert found.as_expected == (verdict == "depends")
    told = found.as_json()
    assert (told["value"], told["expression"]) == (pytest.approx(values[0][0], nan_ok=True), "rmse('a/b', x1)")
    assert [one["verdict"] for one in told["alternatives"]] == [one.verdict for one in found.measured[1:]]
    assert told["alternatives"][0]["expression"] == OTHER["value"]
    assert told["alternatives"][0]["note"] == "on [0, 9]"
    assert found.texts[1].startswith("or ")
    assert found.texts[1].endswith(f", {found.measured[1].verdict}: on [0, 9]")


def test_what_no_finite_run_decides() -> None:
    found = judge(claim(below=1, undecidable="It is about a limit."), [[3]])
    assert (found.verdict, found.as_expected) == ("undecidable", True)
    assert (found.as_json()["value"], found.as_json()["expected"]) == (3, "undecidable")
    without = Claim.model_validate({"id": "1", "claim": "In the end.", "undecidable": "It is about a limit."})
    found = judge(without, [])
    assert (found.verdict, found.texts) == ("undecidable", ["not measured"])
    told = found.as_json()
    assert [told[key] for key in ("value", "threshold", "expression")] == [None, None, None]
    assert told["undecidable"] == "It is about a limit."


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "exactly one of below, above and between"),
        ({"below": 1, "above": 2}, "exactly one of below, above and between"),
        ({"below": 1, "alternatives": [{"value": "rmse('a/b', x1)"}]}, "exactly one of below, above and between"),
        ({"value": "", "below": 1}, "give a value, or say under undecidable"),
        ({"value": "", "below": 1, "undecidable": "A limit."}, "with a value"),
        ({"below": 1, "undecidable": "A limit.", "alternatives": [OTHER]}, "alternatives go with a value that decides"),
    ],
)
def test_claims_that_cannot_be_judged_are_refused(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        claim(**keys)
