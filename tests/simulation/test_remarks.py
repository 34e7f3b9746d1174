"""What is remarked on before a run, although nothing is wrong with its configuration."""

from __future__ import annotations

import pytest
from examples import VAN_DER_POL, experiment

from hgorun.simulation.scheduling import remarks


@pytest.mark.parametrize(("period", "told"), [(1.0, False), (1.5, True)])
def test_a_period_that_is_longer_than_the_run(period: float, told: bool) -> None:
    observers, measurement = {"S": {"type": "shgo", "theta": 2}}, {"sampling": {"period": period}}
    found = remarks(experiment(VAN_DER_POL, observers, measurement=measurement, end=1.0))
    expected = "measurement.sampling.period: 1.5 is longer than the run, 1, so that there is no second sample"
    assert found == ((expected,) if told else ())
