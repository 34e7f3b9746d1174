"""Extended-state observers: what they are limits of, their equations by scipy, and errors of a ramp."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, findings, inline, said, simulated
from scipy.integrate import solve_ivp

from hgorun.analysis.report import analyze
from hgorun.errors import ConfigError
from hgorun.simulation.design.overflow import overflow
from hgorun.simulation.simulate import prepare
from hgorun.tables.advice import advice

DRIVEN = inline({"x1": "x2", "x2": "1.5*u"}, "x1", initial={"x1": 1, "x2": -0.5}, inputs={"u": "sin(2*t)"})


@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.05}}])
def test_on_a_chain_it_is_the_extended_observer(measurement: Block) -> None:
    """phi = b_0 u, continuous and sampled."""
    blocks: dict[str, Block] = {
        "L": {"type": "eso", "omega_o": 4, "b_0": 1.5},
        "X": {"type": "extended", "theta": 4},
        "N": {"type": "neso", "omega_o": 4, "alpha": [1, 1, 1], "delta": 0.1, "b_0": {"u": 1.5}},
    }
    found = simulated(DRIVEN, blocks, end=3, step=0.01, measurement=measurement).observers
    for label in ("L", "N"):
        np.testing.assert_allclose(found[label].xhat, found["X"].xhat, rtol=0, atol=1e-11)
        sigma = found[label].internal["sigma"].ravel()
        np.testing.assert_allclose(sigma, found["X"].internal["sigma"].ravel(), rtol=0, atol=1e-9)


def test_sigma_takes_in_what_the_model_would_know() -> None:
    """On a plant that is no chain of integrators: y'' = -2 y - 0.4 y' + 1.5 u, which sigma + b_0 u follows."""
    plant = inline({"a": "b - 0.4*a", "b": "-2*a + 1.5*u"}, "a", initial={"a": 1, "b": 0}, inputs={"u": "sin(2*t)"})
    run = simulated(plant, {"L": {"type": "eso", "omega_o": 200, "b_0": 1.5}}, end=4, step=5e-4)
    found, late = run.observers["L"], run.time > 1
    np.testing.assert_allclose(found.xhat[late], run.x[late], atol=2e-3)
    expected = -2 * run.x[:, 0] - 0.4 * (run.x[:, 1] - 0.4 * run.x[:, 0])
    np.testing.assert_allclose(found.internal["sigma"][late, 0], expected[late], atol=0.1)


def test_error_of_a_growing_disturbance() -> None:
    """-s (1, k_1, ..., k_n)/k_(n+1) of the estimates and sigma."""
    run = simulated(chain(2, "0.7*t", [1, 0]), {"L": {"type": "eso", "omega_o": 5}}, end=20, step=0.01)
    found = run.observers["L"]
    np.testing.assert_allclose((found.xhat - run.x)[-1], [-0.0056, -0.084], rtol=1e-7)
    np.testing.assert_allclose(found.internal["sigma"][-1, 0] - 0.7 * 20, -0.42, rtol=1e-7)


def test_linear_theory_is_that_of_the_chain_with_one_state_more() -> None:
    """poles -omega_o, noise norms of the same transfer functions as those of the extended observer."""
    blocks: dict[str, Block] = {
        "L": {"type": "eso", "omega_o": 4, "b_0": 1.5, "poles": [-1, -2, -3]},
        "X": {"type": "extended", "theta": 4, "poles": [-1, -2, -3]},
    }
    wanted = [one for one in findings("decay", "noise") if one.name in ("poles", "beta", "chi", "h2")]
    found = analyze(experiment(DRIVEN, blocks, end=2, step=0.01), wanted).observers
    linear, extended = (said(found[label]) for label in ("L", "X"))
    np.testing.assert_allclose(linear["poles"], extended["poles"], atol=1e-12)
    for key in ("beta", "chi", "h2"):
        assert linear[key] == pytest.approx(extended[key], rel=1e-6)


def fal(e: float, alpha: float, delta: float) -> float:
    """As it is printed."""
    return float(e / delta ** (1 - alpha) if abs(e) <= delta else abs(e) ** alpha * np.sign(e))


def test_nonlinear_equations_by_another_integrator() -> None:
    beta, alpha, delta = (12.0, 30.0, 40.0), (1, 0.5, 0.25), 0.05
    block = {"type": "neso", "beta": list(beta), "delta": delta, "b_0": 1.5}
    run = simulated(DRIVEN, {"N": block}, end=2, output_step=0.5, step=2e-4)

    def rate(t: float, w: np.ndarray) -> list[float]:
        x, z = w[:2], w[2:]
        e, u = z[0] - x[0], 1.5 * np.sin(2 * t)
        c = [b * fal(e, a, delta) for b, a in zip(beta, alpha, strict=True)]
        return [x[1], u, z[1] - c[0], z[2] + u - c[1], -c[2]]

    other = solve_ivp(rate, (0, 2), [1, -0.5, 0, 0, 0], t_eval=run.time, method="LSODA", rtol=1e-9, atol=1e-11)
    found = run.observers["N"]
    np.testing.assert_allclose(found.xhat.T, other.y[2:4], rtol=0, atol=2e-5)
    np.testing.assert_allclose(found.internal["sigma"].ravel(), other.y[4], rtol=0, atol=2e-4)


def test_small_errors_are_those_of_the_linear_observer() -> None:
    """Gains beta_i delta^(alpha_i-1) as long as |e| <= delta."""
    beta, delta = np.array([12.0, 30.0, 40.0]), 4.0
    gains = beta * delta ** (np.array([1, 0.5, 0.25]) - 1)
    blocks: dict[str, Block] = {
        "N": {"type": "neso", "beta": beta.tolist(), "delta": delta},
        "L": {"type": "eso", "omega_o": 1, "gains": gains.tolist()},
    }
    found = simulated(chain(2, "-x1", [1, 0]), blocks, end=3, step=0.01).observers
    np.testing.assert_allclose(found["N"].xhat, found["L"].xhat, rtol=0, atol=1e-11)


def test_delta_follows_from_the_noise() -> None:
    noise = {"noise": [{"type": "gaussian", "std": 0.1}], "sampling": {"period": 0.1}}
    run = prepare(experiment(DRIVEN, {"N": {"type": "neso", "omega_o": 4}}, measurement=noise))
    assert run.observers[0].design["delta"] == pytest.approx(0.3)


def test_gains_that_do_not_fit_each_other_are_told() -> None:
    block: Block = {"type": "neso", "beta": [1, 1, 5], "delta": 1}
    run = prepare(experiment(DRIVEN, {"N": block, "M": {**block, "beta": [3, 3, 1]}}, step=0.01))
    (remark,) = run.remarks
    assert remark.startswith("observer N: small errors grow: for |e| <= 1 its gains are 1, 1, 5")


@pytest.mark.parametrize(
    ("block", "measurement", "message"),
    [
        ({"type": "eso", "omega_o": 4}, {"delay": 0.1}, "takes outputs without delay"),
        ({"type": "eso", "omega_o": 4, "poles": [-1, -2]}, {}, "expected 3 numbers"),
        ({"type": "eso", "omega_o": 4, "b_0": {"v": 1}}, {}, "unknown input; the plant has: u"),
        ({"type": "neso", "omega_o": 4}, {}, "delta is missing"),
        ({"type": "neso", "delta": 1}, {}, "either omega_o or beta"),
        ({"type": "neso", "beta": [1, 2], "delta": 1}, {}, "expected 3 numbers, one an equation; found 2"),
        ({"type": "neso", "omega_o": 4, "alpha": [1, 2, 1], "delta": 1}, {}, "powers in .0, 1., found 2"),
    ],
)
def test_what_does_not_fit_is_refused(block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(DRIVEN, {"E": block}, measurement=measurement, step=0.01))


def test_one_number_for_one_input() -> None:
    with pytest.raises(ConfigError, match=r"one number is for one input: give \{input: number\}; the plant has: none"):
        prepare(experiment(chain(2), {"E": {"type": "eso", "omega_o": 4, "b_0": 2}}))


def test_one_state_and_its_disturbance() -> None:
    blocks: dict[str, Block] = {
        "L": {"type": "eso", "omega_o": 5},
        "N": {"type": "neso", "beta": [10, 25], "alpha": [1, 1], "delta": 0.1},
    }
    run = simulated(chain(1, "0.3 + 0*t", 0), blocks, end=8, step=0.01)
    for found in run.observers.values():
        np.testing.assert_allclose(found.xhat[-1], run.x[-1], atol=1e-9)
        np.testing.assert_allclose(found.internal["sigma"][-1], 0.3, rtol=1e-9)


def test_its_rate_is_told_at_its_bandwidth() -> None:
    """All poles at -omega_o, as those of the extended observer of that theta: the same words about both."""
    blocks: dict[str, Block] = {"E": {"type": "eso", "omega_o": 4}, "X": {"type": "extended", "theta": 4}}
    analysis = analyze(experiment(chain(2), blocks, end=1, step=0.01), findings("decay"))
    said_of = [said(analysis.observers[label]) for label in ("E", "X")]
    assert said_of[0]["theta"] == said_of[1]["theta"] == 4
    assert said_of[0]["beta_theta"] == pytest.approx(said_of[1]["beta_theta"], rel=1e-9)
    words = " ".join(advice(analysis))
    assert words.count("decays like exp(-4.000 t)") == 2
    assert "to change: omega_o" in words


OVERFLOWING = [
    ({"type": "eso", "omega_o": 1e300}, "omega_o: 1e.300 is too large: gains that follow from it overflow"),
    ({"type": "neso", "omega_o": 1e300, "delta": 0.5}, "omega_o: 1e.300 is too large"),
    ({"type": "neso", "omega_o": 1e100, "delta": 1e-200}, "delta: 1e-200 is too small"),
    ({"type": "extended", "theta": 1e300}, "theta: 1e.300 is too large"),
    ({"type": "low_power", "theta": 1e300}, "theta: 1e.300 is too large"),
    ({"type": "piecewise", "theta_1": 1e300, "theta_2": 2, "d": 0.1}, "theta_1: 1e.300 is too large"),
    ({"type": "updated", "theta_0": 1e300, "delta": 1}, "theta_0: 1e.300 is too large"),
]


@pytest.mark.parametrize(("block", "message"), OVERFLOWING)
@pytest.mark.filterwarnings("error")
def test_gains_that_overflow_are_named(block: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(chain(2), {"O": block}))


def test_what_is_singular_is_not_called_too_large() -> None:
    plant = inline({"x1": "x2", "x2": "-log(x1)"}, "x1", initial={"x1": 1, "x2": 0})
    with pytest.raises(ConfigError, match="where the equations are singular"):
        prepare(experiment(plant, {"O": {"type": "shgo", "theta": 1e16}}, step=0.01))


def test_numbers_inside_lists_and_mappings_are_looked_at_too() -> None:
    blocks: dict[str, Block] = {
        "S": {"type": "super_twisting", "f": {"x1": 1e300}},
        "N": {"type": "neso", "beta": [1, 1e-200, 3], "delta": 1},
        "E": {"type": "eso", "omega_o": 4},
    }
    run = experiment(chain(2), blocks, step=0.01)
    found = {label: overflow(label, run.observers[label]) for label in blocks}
    assert str(found["S"]).startswith("1e+300 is too large")
    assert str(found["N"]).startswith("1e-200 is too small")
    assert found["E"] is None
