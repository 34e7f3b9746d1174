"""The differentiator: Levant's recursion written out, exactness, and the implicit step."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import chain, simulated

import hgorun
from hgorun.errors import ConfigError, Problem
from hgorun.observers.levant import COEFFICIENTS, levant_flow, levant_gains, levant_implicit_step

H = 1e-3


def simulate(n: int, block: dict[str, Any], end: float, phi: str = "0", start: Any = None, **more: Any) -> Any:
    plant = chain(n, phi, start or 1.0)
    more = {"end": end, "output_step": H, "solver": {"method": "euler", "step": H}, **more}
    return simulated(plant, {"z": {"type": "levant", **block}}, **more)


SAMPLED = {"sampling": {"period": H}}


def recursion(z: np.ndarray, y: float, G: float) -> np.ndarray:
    """v_0..v_k as Levant prints them (k = n - 1, lambda_k in the first equation)."""
    k = len(z) - 1
    v: list[float] = []
    for i in range(k + 1):
        s = z[i] - (y if i == 0 else v[-1])
        p = k - i
        v.append(-COEFFICIENTS[p] * G ** (1 / (p + 1)) * abs(s) ** (p / (p + 1)) * np.sign(s))
        if i < k:
            v[-1] += z[i + 1]
    return np.array(v)


@pytest.mark.parametrize("n", range(1, 7))
def test_the_flow_is_levants_recursion(n: int) -> None:
    symbol = ca.SX.sym("z", n)
    flow = ca.Function("flow", [symbol], [levant_flow(symbol, symbol[0] - 0.3, ca.DM(levant_gains(n, 2.5)))])
    for z in np.random.default_rng(n).normal(size=(10, n)):
        np.testing.assert_allclose(np.asarray(flow(z)).ravel(), recursion(z, 0.3, 2.5), rtol=1e-12)


def test_a_run_is_the_euler_loop() -> None:
    """Third order, far from the output, where no sign is near a change."""
    result = simulate(3, {"G": 2, "initial": {"x1": -3, "x2": 1}}, 0.2, phi="sin(t)")
    x, z = np.ones(3), np.array([-3.0, 1.0, 0.0])
    for i, t in enumerate(result.time):
        np.testing.assert_allclose(result.observers["z"].xhat[i], z, rtol=1e-10)
        z, x = z + H * recursion(z, x[0], 2.0), x + H * np.array([x[1], x[2], np.sin(t)])


@pytest.mark.parametrize(("n", "phi"), [(2, "0"), (2, "0.5"), (3, "0"), (3, "0.5")])
def test_explicit_is_exact_on_polynomials(n: int, phi: str) -> None:
    """A polynomial of degree n - 1 or, with |y^(n)| < G, n: after a while z_i = y^(i) up to O(H^(n-i))."""
    result = simulate(n, {"G": 1, "initial": {"x1": 1.5, "x2": 0.5}}, 12, phi, [1.0, 1.0, 0.2][:n])
    error = np.abs(result.observers["z"].xhat - result.x)[9000:].max(axis=0)
    assert np.all(error < 10 * H ** np.arange(n, 0, -1)), error


@pytest.mark.costly
@pytest.mark.parametrize(("n", "phi"), [(2, "0"), (2, "0.5"), (3, "0"), (3, "0.5")])
def test_implicit_gives_the_difference_quotients_of_polynomials(n: int, phi: str) -> None:
    """z_i = nabla^i y / H^i after a while, to rounding: y^(i) for a ramp, up to O(H) otherwise."""
    block = {"G": 1, "discretisation": "implicit", "initial": {"x1": 1.5, "x2": 0.5}}
    result = simulate(n, block, 12, phi, [1.0, 1.0, 0.2][:n], measurement=SAMPLED)
    for i in range(n):
        quotient = np.diff(result.x[:, 0], i)[9000:] / H**i
        np.testing.assert_allclose(
            result.observers["z"].xhat[9000 + i :, i], quotient, atol=1e-12 / H**i, err_msg=str(i)
        )


@pytest.mark.parametrize("n", range(1, 7))
def test_the_implicit_step_solves_the_implicit_equation(n: int) -> None:
    """z_new = z + h v(z_new, y); where the new error is 0, sign(0) is whatever in [-1, 1] makes it so."""
    gains = levant_gains(n, 3.0)
    symbols = z_, y_, h_ = ca.SX.sym("z", n), ca.SX.sym("y"), ca.SX.sym("h")
    step = ca.Function("step", symbols, [levant_implicit_step(z_, y_, h_, ca.DM(gains))])
    generator = np.random.default_rng(n)
    at_rest = []
    for scale in (0.1, 1.0, 10.0, 1e3):
        for h in (1e-3, 0.1, 2.0):
            z = scale * h ** np.arange(n, 0, -1) * generator.normal(size=n)  # so that no term hides another
            new = np.asarray(step(z, 0.0, h)).ravel()
            at_rest.append(abs(new[0]) < 1e-12 * h**n * scale)
            if at_rest[-1]:
                following = np.append(new[1:], -(z - new)[-1] / h)
                assert abs(following[-1]) <= gains[-1]
            else:
                following = recursion(new, 0.0, 3.0)
                np.testing.assert_allclose(new, z + h * following, rtol=1e-9, atol=1e-9 * np.abs(z).min())
                continue
            np.testing.assert_allclose(new, z + h * following, atol=1e-12 * scale)
    assert 0 < sum(at_rest) < len(at_rest)


def test_implicit_does_not_chatter_where_explicit_does() -> None:
    """On a ramp: the explicit z_1 moves by 1.1 G h every step for ever, the implicit one comes to rest."""
    block = {"G": 50, "initial": {"x1": 1.2, "x2": 0.5}}
    explicit = simulate(2, block, 4.0, measurement=SAMPLED).observers["z"].xhat[2000:, 1]
    implicit = simulate(2, {**block, "discretisation": "implicit"}, 4.0, measurement=SAMPLED)
    still = implicit.observers["z"].xhat[2000:, 1]
    assert np.abs(np.diff(explicit)).min() == pytest.approx(1.1 * 50 * H, rel=1e-6)
    assert np.abs(np.diff(still)).max() < 1e-9
    np.testing.assert_allclose(still, 1.0, atol=1e-9)


def test_implicit_tolerates_long_steps() -> None:
    """G h = 10: the explicit one oscillates by about that, the implicit one gives the difference quotient."""
    run = simulate(2, {"G": 100, "discretisation": "implicit"}, 4.0, "-x1", measurement={"sampling": {"period": 0.1}})
    at = np.arange(1000, 4000, 100)
    z, y = run.observers["z"].xhat[at + 1], run.x[at, 0]
    np.testing.assert_allclose(z[:, 0], y, atol=1e-9)
    np.testing.assert_allclose(z[1:, 1], np.diff(y) / 0.1, atol=1e-7)


def test_the_estimate_is_the_state_that_belongs_to_the_derivatives() -> None:
    """On a plant that is no chain of integrators the estimate is Phi(z)."""
    config = {
        "time": {"end": 6, "output_step": 0.01},
        "plant": {"states": ["a", "b"], "dynamics": {"a": "2*b + u - a", "b": "-a"}, "output": "a + u",
                  "inputs": {"u": "sin(t)"}, "initial": {"a": 0.5, "b": 0.6}},
        "observers": {"z": {"type": "levant", "G": 10}},
        "solver": {"method": "euler", "step": 1e-4},
    }  # fmt: skip
    result = hgorun.simulate(hgorun.Experiment(config, name="test"))
    np.testing.assert_allclose(result.observers["z"].xhat[300:], result.x[300:], atol=5e-3)


def test_more_states_than_coefficients() -> None:
    with pytest.raises(Problem, match="up to 6 states; this plant has 7"):
        levant_gains(7, 1.0)
    with pytest.raises(ConfigError, match="this plant has 7"):
        simulate(7, {"G": 1}, 0.1)


def test_implicit_needs_samples() -> None:
    with pytest.raises(ConfigError, match="needs sampled outputs"):
        simulate(2, {"G": 1, "discretisation": "implicit"}, 0.1)


@pytest.mark.parametrize("implicit", [False, True])
def test_a_power_of_one_half_is_a_root(implicit: bool) -> None:
    """Which is rounded exactly on every machine, and whose slope at zero is infinite and not undefined."""
    z, h = ca.SX.sym("z", 2), ca.SX.sym("h")
    gains = ca.DM(levant_gains(2, 2.5))
    step = levant_implicit_step(z, ca.SX(0.3), h, gains) if implicit else levant_flow(z, z[0] - 0.3, gains)
    function = ca.Function("step", [z, h], [step])
    operations = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert ca.OP_SQRT in operations
    assert not operations & {ca.OP_POW, ca.OP_CONSTPOW}
