"""The Treangle observer; and what the tests of its relatives use too: a plain simulator, the Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError
from hgorun.result.data import ObserverResult
from hgorun.simulation.simulate import prepare

Array = np.ndarray
STEP, END = 0.01, 3.0
SCENARIOS: dict[str, dict[str, float]] = {
    "continuous": {},
    "sampled": {"period": 0.2},
    "sampled late": {"period": 0.2, "delay": 0.13},
    "late": {"delay": 0.17},
}


def experiment(plant: dict[str, Any], observers: dict[str, Any], **more: Any) -> hgorun.Experiment:
    config = {
        "time": {"end": END, "output_step": STEP},
        "plant": plant,
        "observers": observers,
        "solver": {"step": STEP},
        **more,
    }
    return hgorun.Experiment(config, name="test")


def chain(n: int, phi: str = "0", start: float = 0.5) -> dict[str, Any]:
    return {"type": "integrator_chain", "n": n, "phi": phi, "initial": {f"x{i + 1}": start for i in range(n)}}


def measured(period: float | None = None, delay: float = 0.0) -> dict[str, Any]:
    noise = [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3, "phase": 0.5}]}]
    return {"noise": noise, "delay": delay, **({"sampling": {"period": period}} if period else {})}


def noise(t: float) -> float:
    return 0.1 * np.sin(3 * t + 0.5)


def random_poles(count: int, seed: int) -> list[complex]:
    """A stable set with about as many complex pairs as real poles."""
    rng = np.random.default_rng(seed)
    poles: list[complex] = []
    while len(poles) < count:
        real, imaginary = -rng.uniform(0.3, 3), rng.uniform(0.1, 3)
        pair = count - len(poles) > 1 and rng.random() < 0.6
        poles += [complex(real, imaginary), complex(real, -imaginary)] if pair else [complex(real)]
    return poles


def as_text(poles: list[complex]) -> list[str]:
    return [f"{p.real!r}{p.imag:+.17g}j" if p.imag else repr(p.real) for p in poles]


def error_dynamics(plant: dict[str, Any], block: dict[str, Any]) -> tuple[Array, Array]:
    """M, b of w' = M w + b v near x = 0, from the flow that is compiled; w = (xhat, internal)."""
    system = prepare(experiment(plant, {"o": block})).system
    (flow,) = system.structure.flows.values()
    t, p, z, w = (ca.SX.sym(name, flow.size_in(i)) for i, name in enumerate("tpzw"))
    jacobian = ca.Function("J", [t, p, z, w], [ca.jacobian(flow(t, p, z, w), z)])
    J = np.asarray(jacobian(0, system.p, np.zeros(z.shape), np.zeros(w.shape)).full())
    n = len(plant["initial"])
    return J[n:, n:], J[n:, 0]  # the noise comes the way of x_1


def assert_assigned(M: Array, poles: list[complex]) -> None:
    """The characteristic polynomials agree, coefficient by coefficient."""
    np.testing.assert_allclose(np.poly(M), np.real(np.poly(poles)), rtol=1e-9)


# ---- a plain simulator: RK4 of plant x, observer w and alpha ----


def naive(
    plant: Callable[[Array], Array],
    observer: Callable[[Array, float], tuple[Array, float]],
    x0: Array,
    w0: Array,
    period: float | None = None,
    delay: float = 0.0,
) -> Array:
    """w on the grid. ``observer(w, e)`` is w' and the correction c; w[0] is xhat_1.

    Period and delay are multiples of the step; between grid points the past is a cubic.
    """
    n, late = len(x0), round(delay / STEP)
    z = np.concatenate([x0, w0, [0.0]])
    rows, s_y, slopes, held = [z], [], [], 0.0

    def past(half_steps: int) -> Array:
        i, odd = divmod(max(half_steps, 0), 2)
        if not odd:
            return s_y[i]
        return (s_y[i] + s_y[i + 1]) / 2 + STEP * (slopes[i] - slopes[i + 1]) / 8

    for i in range(round(END / STEP)):
        s_y.append(np.array([z[n] - z[-1], z[0]]))
        if period and i % round(period / STEP) == 0:
            s, y = s_y[max(i - late, 0)]
            held = s - y - noise(i * STEP)

        def rate(z: Array, half: int, i: int = i, held: float = held) -> Array:
            x, w, alpha, t = z[:n], z[n:-1], z[-1], (i + half / 2) * STEP
            if period:
                e = held + alpha
            elif late:
                s, y = past(2 * (i - late) + half)
                e = s + alpha - y - noise(t)
            else:
                e = w[0] - x[0] - noise(t)
            dw, c = observer(w, e)
            return np.concatenate([plant(x), dw, [-c]])

        k1 = rate(z, 0)
        slopes.append(np.array([k1[n] - k1[-1], k1[0]]))
        k2 = rate(z + STEP / 2 * k1, 1)
        k3 = rate(z + STEP / 2 * k2, 1)
        k4 = rate(z + STEP * k3, 2)
        z = z + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(z)
    return np.array(rows)[:, n:-1]


def pendulum(x: Array) -> Array:
    return np.array([x[1], x[2], -np.sin(x[1])])


def van_der_pol(x: Array) -> Array:
    return np.array([x[1], -x[0] + 0.5 * (1 - x[0] ** 2) * x[1]])


PLANTS = {
    "pendulum": (pendulum, chain(3, "-sin(x2)")),
    "van der pol": (van_der_pol, {"type": "van_der_pol", "initial": {"x1": 0.5, "x2": 0.5}}),
}
START = np.array([0.2, -0.1, 0.3])


def run_both(
    block: dict[str, Any],
    observer: Callable[[Callable[[Array], Array], int], Callable[[Array, float], tuple[Array, float]]],
    internal: Callable[[int], Array],
    plant: str,
    scenario: str,
) -> tuple[ObserverResult, Array]:
    """hgorun's run and the plain one: ``observer(f, n)`` is its w' and c, ``internal(n)`` what w has more."""
    f, config = PLANTS[plant]
    n = len(config["initial"])
    initial = {f"x{i + 1}": float(START[i]) for i in range(n)}
    measurement = measured(**SCENARIOS[scenario])
    result = hgorun.simulate(experiment(config, {"o": block | {"initial": initial}}, measurement=measurement))
    plain = naive(f, observer(f, n), np.full(n, 0.5), internal(n), **SCENARIOS[scenario])
    return result.observers["o"], plain


# ---- the Treangle observer ----


@pytest.mark.parametrize("n", range(1, 9))
def test_poles_are_assigned(n: int) -> None:
    for seed in range(4):
        poles = random_poles(2 * n, seed)
        M, _ = error_dynamics(chain(n), {"type": "treangle", "theta": 1, "poles": as_text(poles)})
        assert_assigned(M, poles)


def test_theta_scales_the_poles() -> None:
    poles = random_poles(6, 7)
    M, _ = error_dynamics(chain(3), {"type": "treangle", "theta": 5, "poles": as_text(poles)})
    assert_assigned(M, [5 * p for p in poles])


def test_wide_sets_of_poles() -> None:
    """Sixteen poles over four decades, and eight pairs with hardly any damping."""
    wide = [complex(-(10**d)) for d in np.linspace(-2, 2, 16)]
    pairs = [complex(-0.001 * w, sign * w) for w in np.linspace(0.5, 3, 8) for sign in (1, -1)]
    for poles in (wide, pairs):
        block = {"type": "treangle", "theta": 1, "poles": as_text(poles)}
        gains = hgorun.simulate(experiment(chain(8, start=0), {"o": block})).observers["o"].gains
        s = np.array([1.0, 0.3 + 1j, -2 + 0.5j, 3j, 0.01, -0.1])
        p = np.ones_like(s)
        for d, k in zip(gains["delta"], gains["K"], strict=True):
            p = s * (s + d) * p + k
        np.testing.assert_allclose(p, np.prod(s[:, None] - np.array(poles), axis=1), rtol=1e-9)
        assert min(gains["delta"]) > 0


@pytest.mark.parametrize("pole", [-1.0, -2.5])
def test_equal_poles_have_the_known_gains(pole: float) -> None:
    result = hgorun.simulate(experiment(chain(5), {"o": {"type": "treangle", "theta": 2, "poles": pole}}))
    found = result.observers["o"]
    np.testing.assert_allclose(found.gains["delta"], np.full(5, -2 * pole), rtol=1e-12)
    np.testing.assert_allclose(found.gains["K"], [comb(5, i) * pole ** (2 * i) for i in range(1, 6)], rtol=1e-12)
    assert found.dimension == 10
    assert found.internal["e"].shape == (301, 5)


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_against_the_plain_simulator(plant: str, scenario: str) -> None:
    theta = 1.5

    def observer(f: Callable[[Array], Array], n: int) -> Callable[[Array, float], tuple[Array, float]]:
        # all poles at -1: delta_i = 2, k_i = binomial(n, i)
        K = np.diag([comb(n, i) for i in range(1, n + 1)])
        D, A_T, C_T = 2 * np.eye(n), np.eye(n, k=-1), np.eye(n)[:, 0]

        def rates(w: Array, innovation: float) -> tuple[Array, float]:
            xhat, e = w[:n], w[n:]
            dxhat = f(xhat) - theta * K @ e
            de = -theta * D @ e + theta**2 * A_T @ e + theta * C_T * innovation
            return np.concatenate([dxhat, de]), theta * K[0, 0] * e[0]

        return rates

    found, plain = run_both(
        {"type": "treangle", "theta": theta},
        observer,
        lambda n: np.append(START[:n], np.zeros(n)),
        plant,
        scenario,
    )
    n = found.xhat.shape[1]
    np.testing.assert_allclose(found.xhat, plain[:, :n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.internal["e"], plain[:, n:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_one_state_is_fhgo2_with_one_filter(scenario: str) -> None:
    """eta' = theta (-delta eta + e), xhat' = phi - theta k eta."""
    blocks = {name: {"type": name, "theta": 1.5, "gains": [3, 1.7]} for name in ("treangle", "fhgo2")}
    plant = chain(1, "-sin(x1) + cos(t)")
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    one, two = (o.xhat for o in result.observers.values())
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-13)


def test_fhgo1_with_a_stationary_gain_is_treangle_with_equal_filters() -> None:
    """P = P_inf, delta = 4, all poles at -2: P C^T are binomials; the filters carry one more factor delta."""
    k = [3, 3, 1]
    P = [[3, 3, 1], [3, 5, 2], [1, 2, 1]]
    blocks = {
        "one": {"type": "fhgo1", "theta": 2, "delta": 4, "internal": {"P": P}},
        "two": {"type": "treangle", "theta": 2, "poles": -2},
    }
    plant = chain(3)
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(period=0.1)))
    assert result.observers["two"].gains["delta"] == pytest.approx([4, 4, 4])
    assert result.observers["two"].gains["K"] == pytest.approx([k_i * 4**i for i, k_i in enumerate(k, start=1)])
    one, two = (o.xhat for o in result.observers.values())
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-10)


RELATIVES = {
    "treangle": {"type": "treangle", "theta": 2, "poles": -1.5},
    "lowpass": {"type": "lowpass", "theta": 2, "rho": 0.2, "r": 2},
    "integral": {"type": "integral", "theta": 2, "r": 2},
}


@pytest.mark.parametrize("name", RELATIVES)
def test_two_outputs_are_two_observers(name: str) -> None:
    """Chains of three and of two that do not meet."""
    parts = {"a": {"a": "b", "b": "c", "c": "-a - sin(b)"}, "d": {"d": "e", "e": "-2*sin(d)"}}

    def inline(dynamics: dict[str, str], output: Any) -> dict[str, Any]:
        initial = {s: 0.3 + 0.1 * "abcde".index(s) for s in dynamics}
        return {"states": list(dynamics), "dynamics": dynamics, "output": output, "initial": initial}

    def run(plant: dict[str, Any]) -> Array:
        return hgorun.simulate(experiment(plant, {"o": RELATIVES[name]}, measurement=measured(0.1))).observers["o"].xhat

    together = run(inline(parts["a"] | parts["d"], ["a", "d"]))
    apart = np.hstack([run(inline(dynamics, output)) for output, dynamics in parts.items()])
    np.testing.assert_allclose(together, apart, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", [*RELATIVES, "low_power"])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_plant_in_other_coordinates_is_observed_through_the_jacobian(name: str, scenario: str) -> None:
    """z = (a, b, sinh c) is a chain of integrators with phi = -z2 sqrt(1 + z3^2)."""
    block = RELATIVES.get(name, {"type": "low_power", "theta": 2})
    curved = {
        "states": ["a", "b", "c"],
        "dynamics": {"a": "b", "b": "sinh(c)", "c": "-b"},
        "output": "a",
        "initial": {"a": 0.5, "b": 0.4, "c": float(np.arcsinh(0.3))},
    }
    straight = chain(3, "-x2*sqrt(1 + x3**2)") | {"initial": {"x1": 0.5, "x2": 0.4, "x3": 0.3}}
    more = {"measurement": measured(**SCENARIOS[scenario]), "solver": {"step": 0.002}}
    x, z = (
        hgorun.simulate(experiment(plant, {"o": block}, **more)).observers["o"].xhat for plant in (curved, straight)
    )
    np.testing.assert_allclose(np.column_stack([x[:, :2], np.sinh(x[:, 2])]), z, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", RELATIVES)
def test_canonical_and_original_coordinates_agree(name: str) -> None:
    contois = {
        "type": "contois",
        "inputs": {"D": "mu*(1 - abs(sin(t))/2)"},
        "initial": {"x1": 1.5, "x2": 15},
    }
    block = RELATIVES[name] | {"initial": {"x1": 1, "x2": 14}}
    observers = {c: block | {"coordinates": c} for c in ("original", "canonical")}
    more = {"measurement": measured(0.1), "solver": {"step": 0.002}}
    one, two = (o.xhat for o in hgorun.simulate(experiment(contois, observers, **more)).observers.values())
    np.testing.assert_allclose(one, two, rtol=1e-7)


@pytest.mark.parametrize("block", [*RELATIVES.values(), {"type": "low_power", "theta": 2, "poles": [-1, -2, -3, -4]}])
def test_fastest_rate_is_the_spectral_radius(block: dict[str, Any]) -> None:
    e = experiment(chain(3), {"o": block})
    M, _ = error_dynamics(chain(3), block)
    radius = np.max(np.abs(np.linalg.eigvals(M)))
    assert e.observers["o"].fastest_rate(e.forms["o"]) == pytest.approx(radius, rel=0.05)  # defective eigenvalues


@pytest.mark.parametrize(
    ("more", "key", "words"),
    [
        ({"poles": [-1, -2]}, "poles", "expected 6 numbers, or one number for all; found 2"),
        ({"gains": [1, 2, 3]}, "gains", "expected 6 numbers; found 3"),
        ({"poles": -1e60}, "poles", "product of these 6 poles is beyond the range of double precision"),
        ({"poles": -1e-60}, "poles", "put the speed into theta"),
    ],
)
def test_refusals(more: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        prepare(experiment(chain(3), {"o": {"type": "treangle", "theta": 2, **more}}))
    assert error.value.key == f"observers.o.{key}"
