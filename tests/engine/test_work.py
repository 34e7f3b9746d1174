"""How much there is to do in many segments, beside numpy."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.engine import work


@pytest.mark.parametrize("count", [0, 1, 50])
def test_machine_code_adds_as_numpy_does(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = np.random.default_rng(count).integers(0, 9, (count, 7))
    expected = np.cumsum(counts[:, 2] - counts[:, 1] + 1)
    assert np.array_equal(work.work_up_to(counts), expected)
    monkeypatch.setattr(work, "_MANY", 0)
    assert np.array_equal(work.work_up_to(counts), expected)
    assert np.array_equal(work.work_up_to(counts[::2]), np.cumsum(counts[::2, 2] - counts[::2, 1] + 1))
