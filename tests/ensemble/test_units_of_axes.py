"""Units of the axes of ensembles: of noise that of its output, of initial values that of their state."""

from __future__ import annotations

from examples import experiment, inline

from hgorun.ensemble.collected.units import units_of

KNOWN = {"x1": "m", "x2": "m/s"}
GAUSSIAN = [{"type": "gaussian", "std": 0.1}]


def found(path: str, **measurement: object) -> str | None:
    base = experiment(
        inline({"x1": "x2", "x2": "-x1"}, "x1", units=KNOWN),
        {"S": {"type": "shgo", "theta": 1, "initial": {"x2": 1}}},
        measurement={"sampling": {"period": 0.1}, "noise": GAUSSIAN, **measurement},
    )
    return units_of(base, [path]).get(path)


def test_levels_of_noise_are_in_the_unit_of_the_output() -> None:
    assert found("measurement.noise.0.std") == "m"
    assert found("measurement.noise.0.std", mode="multiplicative") is None
    assert found("measurement.noise.0.hold") is None


def test_initial_values_are_in_the_unit_of_their_state() -> None:
    assert found("observers.S.initial.x2") == "m/s"
    assert found("plant.initial.x1") == "m"


def test_gains_have_none() -> None:
    assert found("observers.S.theta") is None
