"""Conditions and bounds of the reduced-order observers for sampled plants."""

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, chain, experiment, inline

from hgorun import Experiment
from hgorun.analysis.papers.katayama import KatayamaConditions, katayama_conditions
from hgorun.analysis.reasons import NoValue
from hgorun.simulation.simulate import prepare, simulate_prepared

OBSERVERS: dict[str, Block] = {"k": {"type": "reduced_sampled", "H": 0.5}, "d": {"type": "deadbeat"}}


def conditions(config: Experiment, label: str) -> KatayamaConditions:
    run = prepare(config)
    found = katayama_conditions(run, label, simulate_prepared(run))
    assert isinstance(found, KatayamaConditions)
    return found


def example(period: float, noise: str | None = "0.2*sin(10*t)", observers: dict[str, Any] | None = None) -> Experiment:
    """(26), with the stiffness that keeps it bounded."""
    measurement = {
        "sampling": {"period": period},
        "noise": [{"type": "expression", "value": noise}] if noise else [],
    }
    return experiment(VAN_DER_POL, observers or OBSERVERS, end=20, output_step=0.01, measurement=measurement)


@pytest.mark.parametrize("slope", [0.3, 0.0])
def test_where_the_bounds_are_reached(slope: float) -> None:
    """x' = z, z' = 0 and n = slope t: Psi is wrong by the slope, and so is z in the end, for both observers."""
    measurement = {"sampling": {"period": 0.1}, "noise": [{"type": "expression", "value": f"{slope}*t"}]}
    observers: dict[str, Block] = {"k": {"type": "reduced_sampled", "H": 1.5}, "d": {"type": "deadbeat"}}
    config = experiment(chain(2, start=[1, 2]), observers, end=50, measurement=measurement)
    for label in ("k", "d"):
        found = conditions(config, label)
        assert found.slope == pytest.approx(slope, abs=1e-9)
        assert found.noise == pytest.approx(50 * slope, rel=1e-9, abs=1e-9)
        assert found.bound == pytest.approx(slope, abs=1e-9)
        assert found.measured == pytest.approx(slope, abs=1e-9)
        assert found.without_noise == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("period", [0.2, 0.05])
def test_the_papers_example(period: float) -> None:
    """f_1 = 0, g = 1; f_2 = -x + (1 - x^2) z/2; n and w in closed form."""
    found = {label: conditions(example(period), label) for label in OBSERVERS}
    c = found["d"].constants
    assert (c.L_1, c.L_3, c.L_4, c.l_1, c.l_2) == (0, 0, 0, 1, 1)
    k = np.arange(round(20 / period) + 1)
    n = 0.2 * np.sin(10 * k * period)
    assert found["d"].noise == pytest.approx(np.max(np.abs(n)), rel=1e-6)
    assert found["d"].slope == pytest.approx(np.max(np.abs(np.diff(n))) / period, rel=1e-6)
    # (25) as it is printed, with gamma for its O(T)
    gap = c.gamma + found["d"].slope
    printed = period * c.gamma + (1 + period * c.L_2) * gap + period * c.L_2 * found["d"].noise
    assert found["d"].bound == pytest.approx(printed)
    for label, one in found.items():
        assert one.A2
        assert one.A3
        assert one.measured is not None
        assert one.bound is not None
        assert one.without_noise is not None
        assert one.measured <= one.bound, label
        assert one.without_noise < one.bound
    # by the paper, the deadbeat observer keeps a large error under noise, the other one does not
    assert found["d"].measured > 3 * found["k"].measured > 0  # type: ignore[operator]  # both are numbers


def test_the_constants_against_a_grid() -> None:
    run = prepare(example(0.05, None))
    result = simulate_prepared(run)
    found = katayama_conditions(run, "d", result)
    assert isinstance(found, KatayamaConditions)
    x, z = result.x.T
    acceleration = -x + 0.5 * (1 - x**2) * z
    jerk = -z - x * z * z + 0.5 * (1 - x**2) * acceleration
    gamma = 0.025 * np.max(np.hypot(acceleration, jerk))
    assert found.constants.gamma == pytest.approx(gamma, rel=1e-3)
    assert found.constants.z == pytest.approx(np.max(np.abs(z)))
    gap = found.constants.gamma + found.slope  # Psi differs from z by no more; the slope is rounding
    X, Z = np.meshgrid(
        np.linspace(x.min(), x.max(), 201), np.linspace(z.min() - gap, z.max() + gap, 201), indexing="ij"
    )
    L_2 = max(np.max(np.abs(-1 - X * Z)), np.max(np.abs(0.5 * (1 - X**2))))
    assert pytest.approx(L_2, rel=1e-6) == found.constants.L_2  # at a corner; x is widened by rounding
    assert found.noise == pytest.approx(0, abs=1e-7)
    assert found.measured is not None
    assert found.without_noise is not None
    assert 0 < found.measured < found.without_noise


def test_the_error_falls_with_the_period_but_for_noise() -> None:
    coarse, fine = (conditions(example(T, None), "d") for T in (0.2, 0.05))
    assert coarse.without_noise is not None
    assert fine.without_noise is not None
    assert fine.without_noise < 0.3 * coarse.without_noise


@pytest.mark.costly
def test_a_plant_whose_gain_g_depends_on_the_output() -> None:
    """L_1, L_3 and L_4 do not vanish: g = 2 + sin x, f_1 = -x - sin(x)/2, with an input and a disturbance."""
    plant = inline(
        {"x": "-x - sin(x)/2 + (2 + sin(x))*z", "z": "-z - x + u"},
        "x",
        inputs={"u": "sin(t)"},
        disturbance={"z": "0.01*cos(t)"},
        initial={"x": 0.1, "z": 0},
    )
    noise = [{"type": "expression", "value": "0.01*sin(3*t)"}]
    measurement = {"sampling": {"period": 0.02}, "noise": noise}
    config = experiment(plant, OBSERVERS, end=20, output_step=0.02, measurement=measurement)
    for label in OBSERVERS:
        found = conditions(config, label)
        assert found.constants.L_1 > 0
        assert found.constants.L_3 > 0
        assert found.constants.L_4 > 0
        assert found.measured is not None
        assert found.bound is not None
        assert 0 < found.measured <= found.bound


def test_beyond_A3() -> None:
    found = conditions(example(0.2, None, {"k": {"type": "reduced_sampled", "H": 11}}), "k")
    assert not found.A3
    assert found.factors == {"x2": pytest.approx(1 - 0.2 * 11)}
    assert found.bound is None
    assert found.measured is None  # diverged


def test_other_observers() -> None:
    config = example(0.2, None, {"o": {"type": "shgo", "theta": 1}})
    run = prepare(config)
    with pytest.raises(NoValue, match="the conditions are for"):
        katayama_conditions(run, "o", simulate_prepared(run))
