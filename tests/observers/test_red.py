"""The robust exact differentiator: recursions written out, a root found otherwise, orders and laws."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, simulated
from scipy.optimize import brentq

import hgorun
from hgorun.errors import ConfigError
from hgorun.export.prepared import exported
from hgorun.observers.levant import implicit_step
from hgorun.observers.red import RobustExactDifferentiator, nonrecursive, quotients_to_derivatives, red_gains
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare
from hgorun.testing import check_observer

NOISE: Block = {"noise": [{"type": "expression", "value": "0.01*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]}
SIGNAL = chain(3, "-cos(t) + 0.0625*sin(0.5*t)", [0.5, 1, -0.125])  # sin t + 0.5 cos 0.5 t

# a recursion written elsewhere, z after sample k = t/h; the noise above, h = 0.01, L = 1.2, samples from t = h on
TRAJECTORIES = {
    "implicit": {
        0.1: (0.14198, 0.19617, 0.13200),
        1: (1.41381, 1.31642, 0.55440),
        5: (-1.36626, 0.10221, 1.02960),
        10: (-0.41140, -0.66772, 0.18480),
    },
    "explicit": {
        0.1: (0.14255, 0.19598, 0.13200),
        1: (1.42748, 1.33056, 0.55440),
        5: (-1.36436, 0.12079, 1.02960),
        10: (-0.42059, -0.67861, 0.15840),
    },
}


def signal(t: np.ndarray, derivative: int) -> np.ndarray:
    """sin t + 0.5 cos 0.5 t, differentiated."""
    turned = derivative * np.pi / 2
    return np.asarray(np.sin(t + turned) + 0.5 ** (1 + derivative) * np.cos(0.5 * t + turned))


def recursion(y: np.ndarray, h: float, a: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """z of t_0 (zero), t_1, ...: one row more than there are samples."""
    n = len(a) - 1
    z = np.zeros((len(y) + 1, n + 1))
    for k, one in enumerate(y):
        s = z[k, 0] - one
        z[k + 1] = drift @ z[k] - h * a * np.abs(s) ** ((n - np.arange(n + 1)) / (n + 1)) * np.sign(s)
    return z


@pytest.mark.slow
@pytest.mark.parametrize("discretisation", ["proper", "explicit"])
def test_contract_of_what_is_not_the_default(discretisation: str) -> None:
    check_observer(RobustExactDifferentiator, {"L": 1.0, "discretisation": discretisation})


@pytest.fixture(scope="module")
def runs() -> Callable[..., hgorun.Result]:
    def run(discretisation: str, **more: object) -> hgorun.Result:
        block = {"type": "red", "L": 1.2, "discretisation": discretisation, **more}
        return simulated(SIGNAL, {"D": block}, end=10.01, output_step=0.01, step=0.01,
                         measurement={"sampling": {"period": 0.01, "offset": 0.01}, **NOISE})  # fmt: skip

    return run


@pytest.mark.costly
@pytest.mark.parametrize("discretisation", TRAJECTORIES)
def test_trajectories_computed_elsewhere(runs: Callable[..., hgorun.Result], discretisation: str) -> None:
    """An explicit step from t_k is the estimate of t_(k+1), where it is taken on."""
    found, later = runs(discretisation).observers["D"].xhat, int(discretisation != "implicit")
    for t, z in TRAJECTORIES[discretisation].items():
        np.testing.assert_allclose(found[round(100 * t) + later], z, rtol=0, atol=6e-6)


def test_proper_keeps_the_taylor_terms_of_the_chain(runs: Callable[..., hgorun.Result]) -> None:
    found, h = runs("proper").observers["D"].xhat, 0.01
    k = np.arange(1, 1001)
    y = signal(h * k, 0) + 0.01 * np.sqrt(2) * np.sin(12.9898 * k**1.5 + k)
    drift = np.array([[1, h, h**2 / 2], [0, 1, h], [0, 0, 1]])
    expected = recursion(y, h, red_gains(2, 1.2), drift)
    np.testing.assert_allclose(found[1:], expected, rtol=0, atol=1e-6)


def test_coefficients() -> None:
    """The published table, to the digits that it has."""
    table = {
        1: "1.1 1.5", 2: "1.1 2.1213 2", 3: "1.1 3.0595 4.1602 3", 4: "1.1 4.5750 9.3024 10.0311 5",
        5: "1.1 6.7516 20.2598 32.2409 23.7164 7",
    }  # fmt: skip
    for n, text in table.items():
        np.testing.assert_allclose(nonrecursive(n), [float(one) for one in text.split()], rtol=0, atol=6e-5)
    a = red_gains(2, 8.0)
    np.testing.assert_allclose(a, [2 * 2, 2.1213203 * 4, 1.1 * 8], rtol=1e-7)


@pytest.mark.parametrize("n", [0, 1, 2, 5, 12])
def test_the_implicit_step_has_the_root_that_bisection_finds(n: int) -> None:
    a = red_gains(n, 3.0)
    z_, h_ = ca.SX.sym("z", n + 1), ca.SX.sym("h")
    step = ca.Function(
        "step", [z_, h_], [implicit_step(z_, ca.SX(0), h_, [ca.SX(one) for one in a], 5 if n < 3 else 6)]
    )
    generator, resting = np.random.default_rng(n), 0
    for h in (1e-3, 0.1, 2.0):
        for scale in (0.1, 1.0, 1e4):
            z = scale * h ** np.arange(n + 1, 0, -1) * generator.normal(size=n + 1)
            b, most = float(h ** np.arange(n + 1) @ z), h ** (n + 1) * a[n]
            if abs(b) <= most:
                resting, s, xi = resting + 1, 0.0, b / most
            else:
                xi = np.sign(b)

                def gap(r: float, h: float = h, b: float = b) -> float:
                    return r ** (n + 1) + sum(h ** (j + 1) * a[j] * r ** (n - j) for j in range(n + 1)) - abs(b)

                s = brentq(gap, 0, abs(b) ** (1 / (n + 1)), xtol=1e-300, rtol=1e-14)
            expected, following = np.zeros(n + 1), 0.0
            for j in reversed(range(n + 1)):
                following = z[j] + h * (following - a[j] * s ** (n - j) * xi)
                expected[j] = following
            size = np.abs(z).max() + np.abs(expected).max()
            np.testing.assert_allclose(np.asarray(step(z, h)).ravel(), expected, rtol=1e-10, atol=1e-12 * size)
    assert 0 < resting < 9


def test_derivatives_from_difference_quotients() -> None:
    """Of polynomials, exactly."""
    z_, h = ca.SX.sym("z", 4), 0.3
    corrected = ca.Function("M", [z_], [quotients_to_derivatives(z_, ca.SX(h))])
    y = np.poly1d([0.7, -0.2, 0.5, 1.0])
    at = 2.0 - h * np.arange(4)[::-1]
    quotients = [np.diff(y(at), j)[-1] / h**j for j in range(4)]
    expected = [y.deriv(j)(2.0) for j in range(4)]
    np.testing.assert_allclose(np.asarray(corrected(quotients)).ravel(), expected, rtol=1e-12)


def test_orders_of_the_error_and_variation() -> None:
    """proper 3, 2, 1; explicit 1 in y'; implicit exact in y, 2, 1; explicit chatters, implicit varies as y'' does."""
    errors: dict[str, list[np.ndarray]] = {"proper": [], "explicit": [], "implicit": []}
    steps = (1e-2, 5e-3)
    for h in steps:
        blocks: dict[str, Block] = {d: {"type": "red", "L": 1.2, "discretisation": d} for d in errors}
        run = simulated(SIGNAL, blocks, end=20, output_step=h, step=h, measurement={"sampling": {"period": h}})
        late = run.time >= 10
        for d, found in errors.items():
            xhat = run.observers[d].xhat[late]
            found.append(np.abs(xhat - run.x[late]).max(axis=0))
            variation = np.abs(np.diff(xhat[:, 2])).sum()
            assert variation == pytest.approx({"explicit": 13.19, "implicit": 6.479, "proper": variation}[d], abs=0.02)
    slopes = {d: np.log2(coarse / fine) for d, (coarse, fine) in errors.items()}
    np.testing.assert_allclose(slopes["proper"], [3, 2, 1], atol=0.3)
    np.testing.assert_allclose(errors["explicit"][0][1], 5.86e-3, rtol=0.02)
    assert slopes["explicit"][1] == pytest.approx(1, abs=0.1)
    assert np.all(errors["implicit"][0][0] < 1e-12)
    np.testing.assert_allclose(errors["implicit"][0][1:], [3.54e-5, 0.01062], rtol=0.01)
    np.testing.assert_allclose(slopes["implicit"][1:], [2, 1], atol=0.02)


def test_implicit_is_exact_on_polynomials() -> None:
    plant = chain(3, "0", [1, 0.3, -0.4])
    blocks: dict[str, Block] = {d: {"type": "red", "L": 1, "discretisation": d} for d in ("implicit", "explicit")}
    run = simulated(plant, blocks, end=20, output_step=0.01, step=0.01, measurement={"sampling": {"period": 0.01}})
    assert np.abs(run.observers["implicit"].xhat[-1] - run.x[-1]).max() < 1e-9
    kept = np.abs(run.observers["explicit"].xhat - run.x)[-200:, 2].max()
    assert kept == pytest.approx(0.018, abs=0.01)


@pytest.mark.costly
def test_scaling(runs: Callable[..., hgorun.Result]) -> None:
    """y -> 8 y, L -> 8 L: z -> 8 z; powers of two of it exactly."""
    once = runs("implicit")
    eight = chain(3, "8*(-cos(t) + 0.0625*sin(0.5*t))", [4, 8, -1])
    noise = [{"type": "expression", "value": "0.08*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]
    scaled = simulated(eight, {"D": {"type": "red", "L": 9.6}}, end=10.01, output_step=0.01, step=0.01,
                       measurement={"sampling": {"period": 0.01, "offset": 0.01}, "noise": noise})  # fmt: skip
    np.testing.assert_allclose(scaled.observers["D"].xhat, 8 * once.observers["D"].xhat, rtol=1e-9, atol=1e-11)


@pytest.mark.costly
def test_a_continuous_output_is_measured_at_the_steps() -> None:
    """Which makes it the recursion of samples with the same period, the first of them at the end of the first step."""
    blocks: dict[str, Block] = {d: {"type": "red", "L": 1.2, "discretisation": d} for d in ("explicit", "implicit")}
    continuous = simulated(SIGNAL, blocks, end=3, output_step=0.01, step=0.01)
    sampled = simulated(SIGNAL, blocks, end=3, output_step=0.01, step=0.01, measurement={"sampling": {"period": 0.01}})
    for d in blocks:
        np.testing.assert_allclose(continuous.observers[d].xhat, sampled.observers[d].xhat, rtol=0, atol=1e-9)


def test_a_lost_sample_makes_a_longer_step() -> None:
    times = [0.1, 0.2, 0.5, 0.6]
    block = {"type": "red", "L": 1.2, "discretisation": "explicit"}
    run = simulated(SIGNAL, {"D": block}, end=0.7, step=0.01, measurement={"sampling": {"times": times}})
    z, a = np.zeros(3), red_gains(2, 1.2)
    for begin, end in pairwise(times):
        h, s = end - begin, z[0] - signal(np.array(begin), 0)
        z = np.array([z[0] + h * z[1], z[1] + h * z[2], z[2]])
        z = z - h * a * np.abs(s) ** (np.array([2, 1, 0]) / 3) * np.sign(s)
        np.testing.assert_allclose(run.observers["D"].xhat[round(end * 10)], z, rtol=1e-7)


def test_substeps_take_the_same_sample_several_times() -> None:
    fine = {"type": "red", "L": 1.2, "discretisation": "explicit", "substeps": 2}
    run = simulated(SIGNAL, {"D": fine}, end=1, step=0.01, measurement={"sampling": {"period": 0.1}})
    h, y = 0.05, np.repeat(signal(0.1 * np.arange(10), 0), 2)
    expected = recursion(y, h, red_gains(2, 1.2), np.eye(3) + h * np.eye(3, k=1))
    np.testing.assert_allclose(run.observers["D"].xhat, expected[::2], rtol=1e-7, atol=1e-9)


def test_exported_code_steps_from_sample_to_sample_alone() -> None:
    (observer,) = exported(prepared({}, measurement={"sampling": {"period": 0.1}}, step=0.01))
    assert observer.jump is not None
    with pytest.raises(ConfigError, match="no place in it for decisions; with sampled outputs it steps"):
        exported(prepared({}, step=0.01))


def prepared(block: Block, **more: object) -> PreparedRun:
    return prepare(experiment(SIGNAL, {"D": {"type": "red", "L": 1, **block}}, **more))  # type: ignore[arg-type]


def test_what_does_not_fit_is_refused() -> None:
    sampled: Block = {"sampling": {"period": 0.1}}
    with pytest.raises(ConfigError, match="takes outputs without delay"):
        prepared({}, measurement={**sampled, "delay": 0.05}, step=0.01)
    with pytest.raises(ConfigError, match="measures a continuous output at the ends of the solver's steps"):
        prepared({})
    with pytest.raises(ConfigError, match="up to 13 states; this plant has 14"):
        prepare(experiment(chain(14), {"D": {"type": "red", "L": 1}}, measurement=sampled))
    with pytest.raises(ConfigError, match="expected a number above 0"):
        prepared({"L": 0})
    for discretisation in ("implicit", "explicit"):
        assert prepared({"discretisation": discretisation}, measurement=sampled).observers
