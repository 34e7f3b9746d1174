"""The words that are said of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.status import OK, STATUSES, Status, Verdict, worst


def test_the_worst_word_counts() -> None:
    assert worst([]) == "ok"
    assert worst([OK, Verdict("inaccurate"), OK]) == "inaccurate"
    assert worst(map(Verdict, STATUSES)) == "failed"
    assert worst([Verdict("undefined", 1.0), Verdict("diverged", 0.5)]) == "undefined"


def test_a_verdict_in_words() -> None:
    verdict = Verdict("undefined", 3.25, "sqrt of a negative number")
    assert OK.sentence("s") == "ok"
    assert verdict.text() == "undefined at t=3.25"
    assert verdict.sentence("h") == "undefined at t=3.25 h: sqrt of a negative number"
    assert Verdict("inaccurate", None, "error 0.02").sentence("h") == "inaccurate: error 0.02"


@pytest.mark.parametrize("word", STATUSES)
def test_an_estimate_is_lost_where_it_has_no_numbers(word: Status) -> None:
    observer = ObserverResult(
        type="shgo", xhat=np.zeros((3, 2)), internal={}, gains={}, dimension=2, verdict=Verdict(word, 1.0)
    )
    assert observer.lost is (word in ("diverged", "undefined", "failed"))
    assert observer.diverged_at == (1.0 if word == "diverged" else None)
    assert replace(observer, xhat=np.array([[0.0, 0.0], [np.nan, 0.0]])).lost
