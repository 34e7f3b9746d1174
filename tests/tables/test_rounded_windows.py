"""Windows above a table are written as people write them."""

from __future__ import annotations

import pytest
from examples import VAN_DER_POL, simulated

from hgorun.tables.metrics import text


@pytest.mark.parametrize(
    ("start", "end", "steady"),
    [
        (0, 5, "1.667 to 5 s"),
        (0, 0.05, "0.01667 to 0.05 s"),
        (1000, 1001, "1000.3333 to 1001 s"),  # to a thousandth of its length or better, however late it is
        (0, 3, "1 to 3 s"),
    ],
)
def test_windows_are_rounded(start: float, end: float, steady: str) -> None:
    time = {"start": start, "end": end, "output_step": (end - start) / 60}
    result = simulated(VAN_DER_POL, {"S": {"type": "shgo", "theta": 2}}, step=(end - start) / 60, time=time)
    assert f"rmse, sup, hf, tv: {steady};" in " ".join(text([result]).split())
