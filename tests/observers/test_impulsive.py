"""Observers that samples correct at any period, against their eigenvalues, least squares and each other."""

from __future__ import annotations

from math import factorial
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from examples import CONTOIS, VAN_DER_POL, Block, chain, experiment, findings, inline, said, simulated
from scipy.linalg import expm

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.base import AnyObserver
from hgorun.observers.impulsive import ImpulsiveObserver, fading_memory_gain, placed_gain
from hgorun.observers.impulsive_riccati import ImpulsiveRiccatiObserver
from hgorun.observers.luenberger_exact import ExactLuenbergerObserver, sampled_gain
from hgorun.testing import check_observer

VDP: Block = VAN_DER_POL | {"parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
NOISE = [{"type": "expression", "value": "0.05*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]


@pytest.mark.slow
@pytest.mark.parametrize("family", [ImpulsiveObserver, ImpulsiveRiccatiObserver, ExactLuenbergerObserver])
def test_contract(family: type[AnyObserver]) -> None:
    check_observer(family)


def integrators(n: int) -> np.ndarray:
    """e^A of a chain of n integrators."""
    return np.array([[1 / factorial(j - i) if j >= i else 0.0 for j in range(n)] for i in range(n)])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_gain_places_all_eigenvalues(n: int) -> None:
    """(I - kappa C) e^A has the characteristic polynomial (s - z)^n, by its coefficients."""
    for z in (0.6, 0.05, 0.99):
        kappa = np.array([float(one) for one in fading_memory_gain(n, 1 - z)])
        closed = (np.eye(n) - np.outer(kappa, np.eye(n)[0])) @ integrators(n)
        np.testing.assert_allclose(np.poly(closed), np.poly(np.full(n, z)), atol=1e-12)


@pytest.mark.parametrize("z", [[0.6], [0.1 + 0.5j, 0.1 - 0.5j], [0.3, 0.9, 0.6 + 0.7j, 0.6 - 0.7j], [0.2, 0.2, 0.2]])
def test_gain_places_each_eigenvalue(z: list[complex]) -> None:
    kappa = [float(one) for one in placed_gain([(ca.SX(1 - one.real), ca.SX(-one.imag)) for one in map(complex, z)])]
    n = len(z)
    closed = (np.eye(n) - np.outer(kappa, np.eye(n)[0])) @ integrators(n)
    np.testing.assert_allclose(np.poly(closed), np.poly(z), atol=1e-12)


def test_poles_of_a_chain() -> None:
    """From sample to sample the error is multiplied by a matrix with the eigenvalues exp(theta T pole)."""
    theta, T, poles = 2.0, 0.3, [-0.5 + 1.0j, -0.5 - 1.0j, -2.0]
    block: Block = {"type": "impulsive", "theta": theta, "poles": [str(one).strip("()") for one in poles]}
    result = simulated(
        chain(3, "0", [1, -1, 0.5]), {"K": block}, end=12 * T, output_step=T, step=T / 10,
        measurement={"sampling": {"period": T, "offset": T}},
    )  # fmt: skip
    error = (result.observers["K"].xhat - result.x)[2:]  # the first interval is the start's
    wanted = np.poly(np.exp(theta * T * np.array(poles))).real
    np.testing.assert_allclose(sum(c * error[3 - i : len(error) - i] for i, c in enumerate(wanted)), 0, atol=1e-9)
    with pytest.raises(ConfigError, match=r"poles: expected 3 numbers, or one number for all; found 2"):
        simulated(
            chain(3, "0"),
            {"K": {"type": "impulsive", "theta": 1, "poles": [-1, -2]}},
            measurement={"sampling": {"period": T}},
        )


def test_equal_poles_are_the_default() -> None:
    measurement = {"sampling": {"period": 0.2, "offset": 0.2}, "noise": NOISE}
    blocks: dict[str, Block] = {
        "default": {"type": "impulsive", "theta": 3},
        "placed": {"type": "impulsive", "theta": 1.5, "poles": -2},
    }
    found = simulated(VDP, blocks, end=3, output_step=0.1, step=0.01, measurement=measurement).observers
    np.testing.assert_allclose(found["placed"].xhat, found["default"].xhat, rtol=0, atol=1e-12)


def test_gains_in_closed_form() -> None:
    z = 0.6
    np.testing.assert_allclose([float(k) for k in fading_memory_gain(2, 1 - z)], [1 - z**2, (1 - z) ** 2], rtol=1e-14)
    third = [1 - z**3, 1.5 * (1 - z) ** 2 * (1 + z), (1 - z) ** 3]
    np.testing.assert_allclose([float(k) for k in fading_memory_gain(3, 1 - z)], third, rtol=1e-14)
    fourth = [0.8704, 0.62293, 0.2048, 0.0256]
    np.testing.assert_allclose([float(k) for k in fading_memory_gain(4, 1 - z)], fourth, rtol=1e-5)


def test_gains_of_short_periods_are_those_of_the_standard_observer() -> None:
    """kappa_i tends to binom(n, i) w^i, without losing digits."""
    kappa = [float(k) for k in fading_memory_gain(4, 1e-5)]
    np.testing.assert_allclose(kappa, [4e-5, 6e-10, 4e-15, 1e-20], rtol=3e-5)


# an independent simulator, RK4 with steps of 0.01; samples at 0.2, 0.4, ..
TRAJECTORY = {
    0.1: (0, 0),
    0.2: (0.73375, 1.06875),
    0.5: (1.06070, 0.87637),
    1: (0.58534, -0.51973),
    2: (-0.73336, -1.41693),
    5: (0.74699, 2.02385),
    10: (-1.49912, 0.96458),
}


def test_trajectory_computed_elsewhere() -> None:
    measurement = {"sampling": {"period": 0.2, "offset": 0.2}, "noise": NOISE}
    block = {"K": {"type": "impulsive", "theta": 3}}
    found = simulated(VDP, block, end=10, output_step=0.1, step=0.01, measurement=measurement).observers["K"]
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(found.xhat[round(10 * t)], expected, rtol=0, atol=6e-6)


def test_the_three_are_one_on_a_chain() -> None:
    """P is at rest after a while, whatever r; the sample at the start corrects neither of the others."""
    measurement = {"sampling": {"period": 0.3}, "noise": NOISE}
    blocks: dict[str, Block] = {
        "I": {"type": "impulsive", "theta": 1.5},
        "R": {"type": "impulsive_riccati", "theta": 1.5, "r": 7},
        "L": {"type": "luenberger_exact", "poles": -1.5},
    }
    found = simulated(chain(3, "0", [1, 0, 0]), blocks, end=30, output_step=0.1, step=0.01, measurement=measurement)
    of = {label: one.xhat for label, one in found.observers.items()}
    np.testing.assert_allclose(of["L"], of["I"], rtol=0, atol=1e-11)
    np.testing.assert_allclose(of["R"][-1], of["I"][-1], rtol=0, atol=1e-8)


def test_error_at_uneven_times_is_that_of_discounted_least_squares() -> None:
    """The estimate of a chain is the polynomial that fits the start and all samples, weighted by exp(-theta age)."""
    times, theta, r, n = np.array([0.3, 0.4, 0.95, 1.6, 1.7]), 1.2, 0.3, 3
    block = {"type": "impulsive_riccati", "theta": theta, "r": r}
    measurement = {"sampling": {"times": times.tolist()}, "noise": NOISE}
    found = simulated(chain(n, "0", [1, 0, 0]), {"K": block}, end=1.7, step=0.002, measurement=measurement)
    end, y = times[-1], found.measurements.y[:, 0]
    rows = np.array([[(t - end) ** j / factorial(j) for j in range(n)] for t in times])
    back = np.array([[(-end) ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(n)] for i in range(n)])
    weights, first = np.exp(-theta * (end - times)) / r, np.exp(-theta * end)
    left = rows.T @ np.diag(weights) @ rows + first * back.T @ back  # P(0) = I, xhat(0) = 0
    np.testing.assert_allclose(found.observers["K"].xhat[-1], np.linalg.solve(left, rows.T @ (weights * y)), atol=1e-9)
    np.testing.assert_allclose(found.observers["K"].internal["P"][-1], np.linalg.inv(left), rtol=1e-8)


def test_error_of_a_chain_falls_as_it_should() -> None:
    """|e| <= const t exp(-theta t), at a period that no high-gain observer bears."""
    block = {"type": "impulsive", "theta": 2}
    for T, bound in ((0.25, 4.2), (4.0, 190)):  # the first interval is the start's
        result = simulated(
            chain(2, "0", [1, 0]), {"K": block}, end=8, output_step=T, step=0.02,
            measurement={"sampling": {"period": T, "offset": T}},
        )  # fmt: skip
        size = np.max(np.abs(result.observers["K"].xhat - result.x), axis=1)
        growth = size * np.exp(2 * result.time) / (1 + result.time)
        assert np.max(growth) <= bound


def test_luenberger_has_the_error_that_is_asked_for() -> None:
    A, T = np.array([[0, 1, 0], [-1, -0.2, 0.5], [0.3, 0, -0.4]]), 0.4
    plant = inline({"a": "b + sin(t)", "b": "-a - 0.2*b + 0.5*c", "c": "0.3*a - 0.4*c + cos(t)"}, "a + c")
    poles = np.array([-0.5, -1 + 2j, -1 - 2j])
    block: Block = {"type": "luenberger_exact", "poles": [-0.5, "-1+2j", "-1-2j"]}
    result = simulated(
        plant, {"K": block}, end=4, output_step=T, step=0.004, measurement={"sampling": {"period": T, "offset": T}}
    )
    C = np.array([[1.0, 0, 1]])
    L = sampled_gain(A, C, poles, T)
    closed = (np.eye(3) - L @ C) @ expm(A * T)
    np.testing.assert_allclose(np.poly(closed), np.poly(np.exp(poles * T)).real, atol=1e-12)
    e = result.observers["K"].xhat - result.x
    for k in range(11):
        np.testing.assert_allclose(e[k], np.linalg.matrix_power(closed, k) @ e[0], rtol=0, atol=1e-9)


def test_luenberger_of_two_outputs() -> None:
    A, C, T = np.array([[0, 1, 0], [-1, 0, 0.5], [0, 0, -0.4]]), np.array([[1.0, 0, 0], [0, 0, 1]]), 0.3
    poles = np.array([-1, -1, -2.0])
    closed = (np.eye(3) - sampled_gain(A, C, poles, T) @ C) @ expm(A * T)
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(closed).real), np.sort(np.exp(poles * T)), atol=1e-6)


def test_gain_of_a_short_period_loses_no_digits() -> None:
    """Against that of the chain in closed form."""
    n, T = 4, 1e-4
    L = sampled_gain(np.eye(n, k=1), np.eye(n)[:1], np.full(n, -2.0), T)[:, 0]
    kappa = [float(k) for k in fading_memory_gain(n, -np.expm1(-2.0 * T))]
    np.testing.assert_allclose(L, [k / T**i for i, k in enumerate(kappa)], rtol=1e-10)


def test_a_lost_sample_makes_a_longer_interval() -> None:
    """At irregular times against the recursion of a few lines."""
    times, theta = [0.2, 0.35, 1.1, 1.2], 2.0
    result = simulated(
        chain(2, "0", [1, 0.5]), {"K": {"type": "impulsive", "theta": theta}}, end=1.2, step=0.01,
        measurement={"sampling": {"times": times}},
    )  # fmt: skip
    x, before = np.zeros(2), 0.0
    for t in times:
        T = t - before
        z = np.exp(-theta * T)
        x = np.array([x[0] + T * x[1], x[1]])
        x = x - np.array([1 - z**2, (1 - z) ** 2 / T]) * (x[0] - (1 + 0.5 * t))
        before = t
    np.testing.assert_allclose(result.observers["K"].xhat[-1], x, rtol=1e-12)


def test_outputs_at_times_of_their_own() -> None:
    """Each chain has its own interval: two plants side by side are two observers."""
    plant = inline({"a": "b", "b": "0", "c": "d", "d": "0"}, {"y": "a", "z": "c"})
    sampling: Block = {"outputs": {"y": {"sampling": {"period": 0.3}}, "z": {"sampling": {"period": 0.5}}}}
    both = simulated(plant, {"K": {"type": "impulsive", "theta": 2}}, end=3, step=0.01, measurement=sampling)
    for output, (first, period) in {"y": ("a", 0.3), "z": ("c", 0.5)}.items():
        one = inline({"a": "b", "b": "0"}, "a")
        alone = simulated(
            one,
            {"K": {"type": "impulsive", "theta": 2}},
            end=3,
            step=0.01,
            measurement={"sampling": {"period": period}},
        )
        at = both.states.index(first)
        assert output in both.outputs
        np.testing.assert_allclose(
            both.observers["K"].xhat[:, at : at + 2], alone.observers["K"].xhat, rtol=0, atol=1e-12
        )


def test_jump_in_z_and_its_first_order() -> None:
    """On a plant that is seen through Phi both follow it, and they differ at the first jumps."""
    of: Block = {"theta": 3, "initial": {"x1": 1.3, "x2": 14}}
    blocks = {
        f"{name} {where}": {"type": name, "coordinates": where, **of}
        for name in ("impulsive", "impulsive_riccati")
        for where in ("original", "canonical")
    }
    result = simulated(CONTOIS, blocks, end=6, step=5e-3, measurement={"sampling": {"period": 0.1}})
    for found in result.observers.values():
        np.testing.assert_allclose(found.xhat[-1], result.x[-1], rtol=1e-4)
    for name in ("impulsive", "impulsive_riccati"):
        gap = result.observers[f"{name} original"].xhat - result.observers[f"{name} canonical"].xhat
        assert np.max(np.abs(gap)) > 1e-3


def test_a_triangular_plant_that_is_observable_at_times() -> None:
    plant = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "u*x2 - x1", "x2": "-0.2*x2 + 0.3"},
        "inputs": {"u": "sin(t)"},
        "output": "x1",
        "initial": {"x1": 0.5, "x2": 2},
    }
    block = {"type": "impulsive_riccati", "theta": 2}
    result = simulated(plant, {"K": block}, end=12, step=0.01, measurement={"sampling": {"period": 0.2}})
    np.testing.assert_allclose(result.observers["K"].xhat[-1], result.x[-1], atol=1e-6)


def test_what_analysis_says() -> None:
    """exp(-theta T), n times; exp(p_i T); white noise behind a sample by its sum over the past."""
    T, theta = 0.3, 1.5
    blocks: dict[str, Block] = {
        "I": {"type": "impulsive", "theta": theta},
        "L": {"type": "luenberger_exact", "poles": [-1, -2, -3]},
        "E": {"type": "ekf", "theta": 2, "R": 0.01},
    }
    run = experiment(chain(3), blocks, end=12, step=0.01, measurement={"sampling": {"period": T, "offset": T}})
    found = hgorun.analyze(run, findings("samples", "stability", "decay")).observers
    np.testing.assert_allclose(
        np.poly(said(found["I"])["period_factors"]), np.poly(np.full(3, np.exp(-theta * T))), atol=1e-9
    )
    np.testing.assert_allclose(said(found["L"])["period_factors"].real, np.exp([-0.3, -0.6, -0.9]), rtol=1e-8)
    assert "stable at every period" in found["I"].reasons["period_critical"]
    assert "corrected by samples alone" in found["E"].reasons["poles"]
    kappa = np.array([float(k) / T**i for i, k in enumerate(fading_memory_gain(3, 1 - np.exp(-theta * T)))])
    np.testing.assert_allclose([row[0] for row in said(found["I"])["sample_gain"].values()], kappa, rtol=1e-8)
    scale = np.diag([T**i for i in range(3)])
    step = (np.eye(3) - np.outer(kappa, np.eye(3)[0])) @ np.linalg.inv(scale) @ integrators(3) @ scale
    powers = np.array([np.linalg.matrix_power(step, k) @ kappa for k in range(200)])
    deviation = np.sqrt(np.sum(powers**2, axis=0))
    np.testing.assert_allclose(list(said(found["I"])["sample_noise"].values()), deviation, rtol=1e-7)


SAMPLED: Block = {"sampling": {"period": 0.1}}
UNEVEN: Block = {"sampling": {"times": [0.1, 0.2, 0.35]}}


@pytest.mark.parametrize(
    ("block", "plant", "measurement", "message"),
    [
        ({"type": "impulsive", "theta": 2}, VDP, {}, "needs sampled outputs"),
        ({"type": "impulsive", "theta": 0}, VDP, SAMPLED, "above 0"),
        ({"type": "impulsive", "theta": 2, "late": "innovation"}, VDP, SAMPLED, "is corrected by samples"),
        ({"type": "impulsive_riccati", "theta": 2, "r": 0}, VDP, SAMPLED, "above 0"),
        ({"type": "impulsive_riccati", "theta": 2, "r": {"z": 1}}, VDP, SAMPLED, "unknown output 'z'"),
        ({"type": "impulsive_riccati", "theta": 2, "internal": {"P": 0}}, VDP, SAMPLED, "must be positive definite"),
        ({"type": "luenberger_exact", "poles": -1}, VDP, SAMPLED, "the slopes of the dynamics are not constant"),
        ({"type": "luenberger_exact", "poles": 1}, chain(2), SAMPLED, "negative real part"),
        ({"type": "luenberger_exact", "poles": [-1, -2, -3]}, chain(2), SAMPLED, "expected 2 numbers, or one"),
        ({"type": "luenberger_exact", "poles": -1}, chain(2), UNEVEN, "samples of x1 are 0.1 to 0.15 apart"),
        ({"type": "luenberger_exact", "poles": -1}, chain(2), {}, "needs sampled outputs"),
        ({"type": "luenberger_exact", "poles": -1}, inline({"a": "0", "b": "-b"}, "a"), SAMPLED, "cannot be observed"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(block: Block, plant: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(plant, {"K": block}, measurement=measurement))


def test_two_outputs_of_luenberger() -> None:
    """Sampled together, and poles not more often than there are outputs."""
    plant = inline({"a": "b", "b": "-a", "c": "-c"}, {"y": "a", "z": "c"})
    together: Block = {"sampling": {"period": 0.2}}
    apart = together | {"outputs": {"z": {"sampling": {"period": 0.4}}}}
    shifted = together | {"outputs": {"z": {"sampling": {"period": 0.2, "offset": 0.1}}}}
    for poles, measurement, message in (
        ([-1, -1, -2], apart, "have periods from 0.2 to 0.4"),
        (-1, together, "cannot be placed"),
        (
            [-1, -1, -2],
            shifted,
            "one period of all outputs, but z has no sample beside that of y at t = 0, the nearest is 0.1 later: take",
        ),
    ):
        with pytest.raises(ConfigError, match=message):
            hgorun.simulate(
                experiment(plant, {"K": {"type": "luenberger_exact", "poles": poles}}, measurement=measurement)
            )


@pytest.mark.costly
def test_a_sweep_of_the_plant_designs_each_gain(tmp_path: Path) -> None:
    """The gain of a linear plant follows its parameters, in company as alone."""
    plant = inline({"a": "b", "b": "-w*a"}, "a", parameters={"w": 1})
    base = experiment(
        plant,
        {"K": {"type": "luenberger_exact", "poles": -2}},
        end=2,
        step=0.01,
        measurement={"sampling": {"period": 0.2}},
    )
    swept = hgorun.sweep(base, {"plant.parameters.w": [1, 2, 4]}, output=f"{tmp_path}/swept.h5")
    rmse = swept.to_xarray()["rmse"].sel(observer="K").values
    for i, w in enumerate((1, 2, 4)):
        alone = hgorun.simulate(base.varied({"plant.parameters.w": w})).observers["K"]
        assert np.array_equal(rmse[i], alone.metrics["rmse"])
