"""Scores of all outputs: each that has errors counts alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hgorun.estimate.gains import cases
from hgorun.estimate.gains.cases import Case, errors_of, score
from hgorun.estimate.gains.goal import Goal


@pytest.mark.parametrize(("of_b", "expected"), [([], 1.0), ([0.6], np.sqrt((1.0 + 9.0) / 2))])
def test_an_output_without_errors_does_not_make_the_score_smaller(
    monkeypatch: pytest.MonkeyPatch, of_b: list[float], expected: float
) -> None:
    """In standard deviations, those of a are one each; b may have no sample before the end of the run."""
    residuals = {"a": [0.1, -0.1, 0.1], "b": of_b}
    held_out = {
        name: SimpleNamespace(taken=np.arange(len(one)), residuals=np.array([one])) for name, one in residuals.items()
    }
    raw = SimpleNamespace(diverged=np.array([[np.inf]]))
    evaluated = SimpleNamespace(held_out=held_out, carried=SimpleNamespace(raw=raw))
    run: Any = SimpleNamespace(experiment=None, run=SimpleNamespace(origin=0.0))
    monkeypatch.setattr(cases, "stated", lambda _: {"a": 0.1, "b": 0.2})
    monkeypatch.setattr(cases, "evaluate_run", lambda *_, **__: evaluated)
    monkeypatch.setattr(Case, "with_gains", lambda *_: run)
    samples: Any = SimpleNamespace(given=SimpleNamespace(outputs={}), search={}, report={})
    case = object.__new__(Case)
    object.__setattr__(case, "samples", samples)
    assert score(errors_of([case], Goal("holdout_rmse", "o", "*"), {})) == pytest.approx(expected)
