"""Orders of convergence: the step is halved and halved again, and the slope of the differences fitted.

Everything that is not smooth lies on events, so each method keeps its order through samples, held noise,
delays and jumps. The slopes are clean where events are commensurate with the steps.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import run, simulated

SINE = [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3}]}]
DRAWN = [{"type": "gaussian", "std": 0.1}]
HELD = [{"type": "gaussian", "std": 0.1, "hold": 0.5}]
PERIODIC = {"sampling": {"period": 0.4}, "noise": DRAWN}
LATE = {"delay": "where(sin(7*t) > 0, 0.2, 0.8)"}  # overtaking each other, multiples of the step
END = 6.0

VAN_DER_POL = {
    "type": "van_der_pol",
    "initial": {"x1": 1, "x2": 0.5},
    "disturbance": {"x2": "0.2*sin(0.7*t)"},
}


def inline(right_side: str, inputs: dict[str, str]) -> dict[str, Any]:
    return {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": right_side},
        "output": "x1",
        "inputs": inputs,
        "initial": {"x1": 1, "x2": 0.5},
    }


JUMPING = inline("0.5*(1 - x1**2)*x2 - x1 + u", {"u": "sign(sin(pi*t/0.6))"})
JUMPING_OUTPUT = JUMPING | {"output": "x1*(2 + u)"}  # which a delay brings back, jump by jump
# kinks of time alone, wherever they are written: in an input, through an input, in the equations
KINKED = {
    "input": inline("0.5*(1 - x1**2)*x2 - x1 + u", {"u": "abs(sin(pi*t/0.6))"}),
    "of an input": inline("0.5*(1 - x1**2)*x2 - x1 + abs(u)", {"u": "sin(pi*t/0.6)"}),
    "dynamics": inline("0.5*(1 - x1**2)*x2 - x1 + abs(sin(pi*t/0.6))", {}),
}


def orders(
    folder: Path,
    steps: list[float],
    measurement: dict[str, Any],
    method: str = "rk4",
    plant: dict[str, Any] = VAN_DER_POL,
    theta: float = 1.5,
    output_step: float = 0.2,
) -> dict[str, float]:
    """The fitted slope of the plant and of each observer with its internal states, largest over the run.

    The output grid is part of the steps unless ``output_step`` says otherwise.
    """
    common = {"theta": theta, "initial": {"x1": 0.2, "x2": -0.3}}
    config = {
        "time": {"end": END, "output_step": output_step},
        "plant": plant,
        "measurement": measurement,
        "observers": {"S": {"type": "shgo", **common}}
        | {f"F{r}": {"type": "fhgo2", "r": r, **common} for r in (1, 2, 3)},
    }
    runs = []
    for step in steps:
        result = run(folder, config | {"solver": {"method": method, "step": step}})
        rows = {"plant": result.x}
        for label, found in result.observers.items():
            eta = found.internal.get("eta", np.zeros((len(result.time), 0)))
            rows[label] = np.hstack([found.xhat, eta])
        runs.append(rows)
    slopes = {}
    for name in runs[0]:
        errors = [np.abs(a[name] - b[name]).max() for a, b in pairwise(runs)]
        slopes[name] = -np.polyfit(np.log2([steps[0] / s for s in steps[:-1]]), np.log2(errors), 1)[0]
    return slopes


def halved(step: float, count: int = 4) -> list[float]:
    return [step / 2**k for k in range(count)]


RK4_SCENARIOS: dict[str, dict[str, Any]] = {
    "continuous": {"noise": SINE},
    "held noise": {"noise": HELD},
    "multiplicative": {"noise": HELD, "mode": "multiplicative"},
    "sampled": PERIODIC,
    "sampled, late, out of order": PERIODIC | LATE,
    "constant delay": {"delay": 0.25, "noise": SINE},
    "constant delay, held noise": {"delay": 0.25, "noise": HELD},
    "varying delay": {"delay": "0.5 + 0.05*sin(4*pi*t)", "noise": SINE},  # its breakpoints: multiples of 0.5
    "delay from zero": {"delay": "0.1*(1 - cos(t))", "noise": SINE},
    "delay with kinks at zero": {"delay": "0.3*abs(sin(pi*t/2))", "noise": SINE},
    "delay far below the step": {"delay": 1e-4, "noise": SINE},
    "delay that jumps": {"delay": "0.2 + 0.1*sign(sin(pi*t/1.5))", "noise": SINE},
    "phases": {
        "noise": SINE,
        "phases": [
            {"until": 2, "sampling": "continuous"},
            {"until": 4, "sampling": {"period": 0.4}, "delay": 0.2},
            {"until": 6, "sampling": "continuous", "delay": 0.4},
        ],
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", RK4_SCENARIOS)
def test_rk4_is_of_order_four(name: str, tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.025), RK4_SCENARIOS[name])
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("delay", ["0.25 + 0.1*sin(t)", "0.25 + 0.25*sin(t)"])
def test_rk4_is_of_order_four_between_irregular_breakpoints(delay: Any, tmp_path: Path) -> None:
    """Steps in short gaps are not quite halved: the slope is clean later, at the end of the run."""
    found = orders(tmp_path, halved(0.05), {"delay": delay, "noise": SINE}, output_step=END)
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("plant", [JUMPING, JUMPING_OUTPUT], ids=["input", "output"])
@pytest.mark.parametrize(
    "measurement",
    [{"noise": SINE}, PERIODIC | LATE, {"delay": 0.2}],
    ids=["continuous", "sampled, late", "constant delay"],
)
def test_rk4_keeps_its_order_through_jumps(measurement: dict[str, Any], plant: dict[str, Any], tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.025), measurement, plant=plant)
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("where", KINKED)
def test_rk4_keeps_its_order_through_kinks(where: str, tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.025), {"noise": SINE}, plant=KINKED[where])
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("name", ["sampled", "constant delay"])
def test_rk4_between_its_steps_is_of_order_four(name: str, tmp_path: Path) -> None:
    """Output points that no step lands on: the cubic Hermite polynomial."""
    found = orders(tmp_path, halved(0.025), RK4_SCENARIOS[name], output_step=0.0037)
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{"noise": SINE}, {"noise": HELD}, PERIODIC, PERIODIC | LATE])
def test_dopri5_with_fixed_steps_is_of_order_five(measurement: dict[str, Any], tmp_path: Path) -> None:
    """Its fifth-order terms are small on purpose: only short steps show them alone."""
    found = orders(tmp_path, halved(0.025), measurement, "dopri5")
    assert found == pytest.approx(dict.fromkeys(found, 5.0), abs=0.2)


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{"noise": SINE}, PERIODIC | LATE])
@pytest.mark.parametrize("plant", [VAN_DER_POL, JUMPING], ids=["smooth", "jumping input"])
def test_rodas5p_with_fixed_steps_is_of_order_five(
    plant: dict[str, Any], measurement: dict[str, Any], tmp_path: Path
) -> None:
    """With an input that is a function of time: df/dt counts."""
    found = orders(tmp_path, halved(0.05), measurement, "rodas5p", plant=plant)
    assert found == pytest.approx(dict.fromkeys(found, 5.0), abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.25, "0.5 + 0.05*sin(4*pi*t)"])
def test_rodas5p_with_a_continuous_delay_has_the_order_of_the_cubic_history(delay: Any, tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.025), {"delay": delay, "noise": SINE}, "rodas5p")
    del found["plant"]
    assert min(found.values()) > 3.9


def test_dopri5_with_a_continuous_delay_has_the_order_of_the_cubic_history(tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.025), {"delay": 0.25, "noise": SINE}, "dopri5")
    del found["plant"]
    assert found == pytest.approx(dict.fromkeys(found, 4.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{"noise": SINE}, PERIODIC | LATE, {"delay": 0.25}])
def test_euler_is_of_order_one(measurement: dict[str, Any], tmp_path: Path) -> None:
    found = orders(tmp_path, halved(0.0025), measurement, "euler")
    assert found == pytest.approx(dict.fromkeys(found, 1.0), abs=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("solver", [{"method": "euler"}, {"method": "rk4"}, {"method": "dopri5"}], ids=str)
@pytest.mark.parametrize("finer", [False, True])
def test_the_estimated_error_of_a_given_step_is_at_least_the_error(
    solver: dict[str, Any], finer: bool, tmp_path: Path
) -> None:
    """And not much larger, relative to the metrics: methods of order four and five are taken to be of order two."""
    config = {
        "time": {"end": END, "output_step": 0.2},
        "plant": VAN_DER_POL,
        "measurement": {"noise": SINE},
        "observers": {"F": {"type": "fhgo2", "r": 2, "theta": 1.5}},
    }
    result = run(tmp_path, config | {"solver": solver | {"step": 0.02}}, check_step=finer)
    exact = run(tmp_path, config | {"solver": {"step": 0.001}})
    size = np.abs(exact.x).max(axis=0)
    error = {"plant": float(np.max(np.abs(result.x - exact.x).max(axis=0) / size))}
    gaps = [
        np.abs(result.observers["F"].metrics[name] / exact.observers["F"].metrics[name] - 1)
        for name in ("rmse", "sup", "peak", "tv")
    ]
    error["F"] = float(np.max(gaps))
    estimate = result.integration_error
    assert estimate is not None
    for label, is_error in error.items():
        assert 0.9 * is_error <= estimate[label] <= 30 * is_error, (label, is_error, estimate[label])


def test_delays_that_look_into_the_step() -> None:
    """Much shorter than a step: what the step itself gives is looked up, again until it is of the method's order."""

    def last(step: float) -> np.ndarray:
        observers = {"H": {"type": "shgo", "theta": 2}}
        late = {"delay": 5e-4}
        plant = VAN_DER_POL
        return (
            simulated(plant, observers, end=2.0, output_step=0.5, step=step, measurement=late).observers["H"].xhat[-1]
        )

    exact = last(2.5e-4)
    errors = [float(np.max(np.abs(last(step) - exact))) for step in (0.08, 0.04, 0.02)]
    assert all(a > 10 * b for a, b in pairwise(errors))
