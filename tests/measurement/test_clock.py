"""A clock that began long ago: the same samples and draws, in spite of the digits that its times have lost."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest

import hgorun

CHAIN = {"states": ["x1", "x2"], "dynamics": {"x1": "x2", "x2": "-x1"}, "output": "x1", "initial": {"x1": 1, "x2": 0}}
DRAWN: dict[str, Any] = {"type": "gaussian", "std": 0.1}


def simulated(start: float, measurement: dict[str, Any], phases: tuple[float, ...] = ()) -> hgorun.Result:
    if phases:
        parts = [measurement | {"until": start + until} for until in (*phases, 10)]
        measurement = {"phases": parts}
    e = examples.experiment(CHAIN, {"S": {"type": "shgo", "theta": 2}}, end=10, step=1e-3, measurement=measurement)
    return hgorun.simulate(e.varied({"time.start": start, "time.end": start + 10, "time.output_step": 0.005}))


@pytest.mark.parametrize("start", [1e6, 1.7e9, -1.7e9])
@pytest.mark.parametrize(
    "measurement",
    [
        {"noise": [DRAWN | {"hold": 0.01}]},
        {"sampling": {"period": 0.01}, "noise": [DRAWN]},
        {"sampling": {"period": 0.1, "jitter": 0.02, "dropout": 0.3}, "delay": 0.05, "noise": [DRAWN]},
    ],
    ids=["held", "sampled", "jitter"],
)
@pytest.mark.parametrize("phases", [(), (3.3,)], ids=["whole", "phases"])
def test_the_clock_changes_neither_draws_nor_samples(
    start: float, measurement: dict[str, Any], phases: tuple[float, ...]
) -> None:
    early, late = simulated(0, measurement, phases), simulated(start, measurement, phases)
    assert early.time.size == late.time.size
    assert early.measurements.time.size == late.measurements.time.size
    digits = 20 * np.spacing(abs(start))
    np.testing.assert_allclose(late.measurements.y, early.measurements.y, atol=digits)
    np.testing.assert_allclose(late.observers["S"].xhat, early.observers["S"].xhat, atol=200 * digits)


@pytest.mark.parametrize("start", [0, 1e6, 1.7e9])
def test_the_observer_gets_what_is_recorded(start: float) -> None:
    """Held noise on a continuous output: as many draws in the file as there are."""
    result = simulated(start, {"noise": [DRAWN | {"hold": 0.01}]})
    noise = result.measurements.y[:, 0] - result.x[:, 0]
    assert np.count_nonzero(np.abs(np.diff(noise)) > 1e-6) == 1000
