"""What is remarked on before a run, although nothing is wrong with its configuration."""

from __future__ import annotations

from pathlib import Path

import pytest
from examples import VAN_DER_POL, Block, experiment, inline

import hgorun
from hgorun import ConfigError
from hgorun.simulation.preparation.scheduling import remarks
from hgorun.simulation.simulate import prepare


@pytest.mark.parametrize(("period", "told"), [(1.0, False), (1.5, True)])
def test_a_period_that_is_longer_than_the_run(period: float, told: bool) -> None:
    observers, measurement = {"S": {"type": "shgo", "theta": 2}}, {"sampling": {"period": period}}
    found = remarks(experiment(VAN_DER_POL, observers, measurement=measurement, end=1.0))
    expected = (
        "measurement.sampling.period: 1.5 is longer than the run, 1, so that there is no second sample; times are in s"
    )
    assert [remark.partition(": ")[2] for remark in found] == [expected] * told


@pytest.mark.parametrize(
    ("measurement", "told"),
    [
        (
            {"delay": 1.0},
            "measurement.delay: 1 is not shorter than the run, 1, so that nothing arrives that was measured",
        ),
        ({"sampling": {"period": 0.1}, "delay": 7}, "measurement.delay: 7 is not shorter than the run, 1, so that"),
        ({"delay": "t + 1"}, "measurement.delay: it is never shorter than the run so far, so that nothing arrives"),
        ({"delay": 0.9}, ""),
        ({"delay": "t/2"}, ""),
        ({"sampling": {"period": 0.1}, "phases": [{"until": 0.5, "delay": 3}, {"until": 1, "delay": 0.7}]}, ""),
        (
            {"sampling": {"period": 0.8, "offset": 0.5}},
            "sampling.period: one sample of x1 arrives in the run, which ends at 1",
        ),
        ({"sampling": {"steps": "2 + k"}}, "sampling: one sample of x1 arrives in the run"),
        ({"sampling": {"times": [0.5, 3]}}, "sampling: one sample of x1 arrives in the run"),
        ({"sampling": {"times": [0.5]}}, ""),
    ],
)
def test_what_never_reaches_an_observer(measurement: Block, told: str) -> None:
    made = experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 2}}, measurement=measurement)
    found = remarks(made)
    assert len(found) == bool(told)
    assert told in "".join(found)
    assert not found or found[0].endswith("; times are in s")


def test_a_run_that_does_not_start_at_zero() -> None:
    """A delay is compared with the length of the run."""
    made = experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 2}}, measurement={"delay": 0.9})
    assert remarks(made.varied({"time.start": 100, "time.end": 101})) == ()
    (found,) = remarks(made.varied({"time.start": 100, "time.end": 101, "measurement.delay": 2}))
    assert "2 is not shorter than the run, 1," in found


def test_an_output_of_several_of_which_no_sample_arrives() -> None:
    """Of all outputs this is refused."""
    plant = inline({"x1": "x2", "x2": "-x1"}, {"a": "x1", "b": "x2"})
    sampled = {"sampling": {"period": 0.1}, "outputs": {"b": {"sampling": {"period": 0.1, "offset": 30}}}}
    observers = {"S": {"type": "ekf", "Q": {"x1": 0.1, "x2": 0.1}, "R": 0.1}}
    (found,) = remarks(experiment(plant, observers, measurement=sampled))
    assert ": measurement.outputs.b.sampling.offset: the first sample of b would come 30 after the start" in found
    with pytest.raises(
        ConfigError, match=r"sampling.offset: no sample arrives between 0 and 1: the first comes 30 after"
    ):
        prepare(experiment(plant, observers, measurement={"sampling": {"period": 0.1, "offset": 30}}))


def test_a_remark_names_file_and_line(tmp_path: Path) -> None:
    file = tmp_path / "late.yaml"
    text = """\
time: {end: 1, output_step: 0.1, unit: h}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}
measurement:
  delay: 20
observers: {S: {type: shgo, theta: 2}}
"""
    file.write_text(text)
    (found,) = remarks(hgorun.load(str(file)))
    assert found.startswith("late.yaml:4: measurement.delay: 20 is")
    assert found.endswith("times are in h")
    (found,) = remarks(hgorun.load(str(file), ["measurement.delay=30"]))
    assert found.startswith("--set measurement.delay=30: measurement.delay: 30 is")
