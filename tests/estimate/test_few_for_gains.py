"""Few samples that decide on several numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from hgorun.estimate.gains import tuning
from hgorun.estimate.scores.outlying import Errors


@pytest.mark.parametrize(
    ("count", "gains", "told"),
    [
        (1, 1, ["in the search one sample decides on E.Q.0, so few that chance meets them"]),
        (9, 2, ["in the search 9 samples decide on E.Q.0, E.Q.1, so few that chance meets them"]),
        (10, 2, []),
    ],
)
def test_so_few_are_told(monkeypatch: pytest.MonkeyPatch, count: int, gains: int, told: list[str]) -> None:
    def errors(*_: Any, report: bool = False) -> list[Errors] | None:
        return None if report else [Errors("X", np.arange(float(count)), np.full(count, 0.1), 0.0, None, 1)]

    monkeypatch.setattr(tuning, "errors_of", errors)
    trials = cast(tuning.Trials, SimpleNamespace(cases=[], goal=None, left_out=None))
    _, remarks = tuning.reported(trials, {f"observers.E.Q.{k}": 1.0 for k in range(gains)})
    assert [one.partition(":")[0] for one in remarks] == told
