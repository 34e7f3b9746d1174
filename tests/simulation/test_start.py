"""What is not a number at the start of a run: the message names the operation, its argument and the states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hgorun import simulate
from hgorun.errors import ConfigError
from hgorun.simulation.divergence.why_diverged import _sign_changes


def config(dynamics: str, output: str = "x1", **observer: Any) -> dict[str, Any]:
    return {
        "time": {"end": 0.1, "output_step": 0.05},
        "plant": {
            "states": ["x1", "x2"],
            "parameters": {"c": 3},
            "dynamics": {"x1": "x2", "x2": dynamics},
            "output": output,
            "initial": {"x1": 1, "x2": -2},
        },
        "observers": {"S": {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": -2}} | observer},
        "solver": {"step": 0.05},
    }


@pytest.mark.parametrize(
    ("dynamics", "what"),
    [
        ("1/(x1 - 1) + 0*c", "division by zero (x1 = 1), at x1 = 1, x2 = -2"),
        ("log(x2 - c*x1)", "log of a number that is not positive (-5), at x1 = 1, x2 = -2"),
        ("sqrt(x2) + c", "sqrt of a negative number (x2 = -2), at x1 = 1, x2 = -2"),
        ("-x1*exp(1000*c)", "exp of 3000 is larger than numbers can be, at x1 = 1, x2 = -2"),
    ],
)
def test_a_plant_that_is_no_number_names_the_operation(dynamics: str, what: str) -> None:
    with pytest.raises(ConfigError) as caught:
        simulate(config(dynamics))
    assert caught.value.key == "plant.dynamics.x2"
    assert caught.value.message == f"the right-hand side of x2 is not a finite number at the start of the run: {what}"


def test_an_output_that_is_no_number_is_not_put_on_the_observer() -> None:
    found = config("-c*x1", output="x1 + 1/(x2 + 2)", initial={"x1": 1, "x2": 3})
    with pytest.raises(
        ConfigError, match="output y1 is not a finite number at the start of the run, at x1 = 1, x2 = -2"
    ):
        simulate(found)


@pytest.mark.parametrize("sampling", [{"period": 0.05}, {"period": 0.05, "offset": 0.02}])
def test_nor_is_one_that_is_sampled(sampling: dict[str, float]) -> None:
    """All right-hand sides are numbers until the first sample comes."""
    found = config("-c*x1", output="log(x2)", type="ekf", q=1, R=1)
    del found["observers"]["S"]["theta"]
    found["measurement"] = {"sampling": sampling}
    with pytest.raises(
        ConfigError, match="output y1 is not a finite number at the start of the run, at x1 = 1, x2 = -2"
    ):
        simulate(found)


@pytest.mark.parametrize(
    ("values", "expected"),
    [([], None), ([np.nan, 1.0], None), ([2.0, 1.0], None), ([1.0, -1.0], 0.5), ([2.0, 1.0, 0.0], 2.0)],
)
def test_a_sign_changes_between_two_numbers_alone(values: list[float], expected: float | None) -> None:
    """What has no rows has no sign."""
    assert _sign_changes(np.arange(float(len(values))), np.array(values)) == expected


def test_an_estimate_that_is_no_number_names_itself() -> None:
    with pytest.raises(ConfigError) as caught:
        simulate(config("-c*x1 + log(x2 + 3)", initial={"x1": 1, "x2": -4}))
    assert caught.value.key == "observers.S"
    assert "log of a number that is not positive (estimate of x2 = -4), at x1 = 1, x2 = -4: its" in caught.value.message
    assert "singular" in caught.value.message


def test_an_estimate_that_is_too_large_is_said_to_be() -> None:
    """Where no gain is to blame: x2 of 400 makes exp overflow."""
    with pytest.raises(ConfigError) as caught:
        simulate(config("-c*x1 + exp(x2**2)", initial={"x1": 0, "x2": 400}))
    said = "exp of 160000 is larger than numbers can be, at x1 = 0, x2 = 400: its initial estimate is too large"
    assert caught.value.message.endswith(said)


def test_a_number_that_is_not_finite_is_shown() -> None:
    with pytest.raises(ConfigError, match="the number inf is not finite"):
        simulate(config("-c*x1", initial={"x1": float("inf"), "x2": 0}))


def test_a_pole_of_a_function_of_time_is_at_its_time() -> None:
    with pytest.raises(ConfigError, match="this is not finite at t = 0: it has"):
        simulate(config("-c*x1/t"))


@pytest.mark.costly
@pytest.mark.parametrize("start", [0.0, 7.0])
def test_a_step_longer_than_the_run_is_told(start: float) -> None:
    found = config("-c*x1")
    found["time"] = {"start": start, "end": start + 0.1, "output_step": 0.05, "unit": "h"}
    assert simulate(found | {"solver": {"step": 0.1}}).remarks == ()  # as long as the run
    (told,) = simulate(found | {"solver": {"step": 0.11}}).remarks
    assert "solver.step: 0.11 is longer than the run, 0.1: steps end where output is written" in told
    assert told.endswith("times are in h")
