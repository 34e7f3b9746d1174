"""Differences of two passes are found piece by piece: the same numbers as of whole arrays."""

import numpy as np
import pytest

from hgorun.simulation.error_control import error_estimate


@pytest.mark.parametrize("rows", [0, 1, 63, 64, 65, 200])
@pytest.mark.parametrize("odd", [None, np.nan, np.inf, -np.inf])
def test_reach_and_gap_leave_out_what_is_no_number(
    rows: int, odd: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(error_estimate, "_PIECE", 64)
    a, b = np.random.default_rng(rows).normal(size=(2, rows, 3))
    if odd is not None and rows:
        a[rows // 2, 1] = odd
    with np.errstate(invalid="ignore"):
        difference = a - b
    for found, values in ((error_estimate._reach(a), a), (error_estimate._gap(a, b), difference)):
        expected = np.max(np.abs(np.where(np.isfinite(values), values, 0.0)), axis=0, initial=0.0)
        np.testing.assert_array_equal(found, expected)
