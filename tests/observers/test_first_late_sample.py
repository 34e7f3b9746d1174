"""Late samples whose first is taken at the start, less than a period before the second."""

from __future__ import annotations

import pytest
from examples import Block, experiment, inline

from hgorun import simulate
from hgorun.errors import HgorunError


def test_late_samples_whose_first_is_cut_off_are_told_with_the_offset_that_evens_them() -> None:
    """At t_k = 0, 0.25, 0.5 samples arrive that were taken at 0, 0, 0.2; with an offset of 0.05, at 0, 0, 0.25."""
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", initial={"x1": 1, "x2": 0})
    observers: dict[str, Block] = {"L": {"type": "luenberger_exact", "poles": [-1, -2]}}
    for offset in (0.0, 0.05):
        measurement = {"sampling": {"period": 0.25, "offset": offset}, "delay": 0.3}
        asked = experiment(plant, observers, end=2, step=0.05, measurement=measurement)
        if offset:
            assert simulate(asked).observers["L"].status == "ok"
        else:
            with pytest.raises(HgorunError, match=r"an offset that is 0\.05 longer gives even ones"):
                simulate(asked)
