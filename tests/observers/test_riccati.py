"""Observers with time-varying gain against a plain simulator, and the laws of their Riccati equation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from examples import simulated

import hgorun
from hgorun.errors import ConfigError


def run(plant: dict[str, Any], observer: dict[str, Any], end: float, step: float, **more: Any) -> hgorun.Result:
    return simulated(plant, {"o": observer}, end=end, step=step, **more)


# ---- the oracle: plain numpy, from the mathematics alone ----
#
# x is the plant's state, w the estimate where the observer computes, alpha' = -c; between samples
# e = (C w - alpha)(taken) + alpha(t) - y_k. Several outputs: e, c, alpha have one entry each.

Array = np.ndarray


def p_rate(P: Array, F: Array, k: Array) -> Array:
    """P + F P + P F^T - k k^T, in sums that keep P symmetric to the last bit."""
    FP = F @ P
    return P + (FP + FP.T) - k @ k.T


class Shgo:
    """rates(F, C, e, P, ...): what is subtracted from w', and the derivatives of P and of what follows it."""

    def __init__(self, theta: float, block: list[int], q: int) -> None:
        self.theta, self.powers, self.n, self.q = theta, np.array([theta**b for b in block]), len(block), q

    def start(self, p: float = 1.0) -> list[Array]:
        return [p * np.eye(self.n)]

    def rates(self, F: Array, C: Array, e: Array, *rest: Array) -> tuple[Array, list[Array]]:
        (P,) = rest
        K = P @ C.T
        return self.theta * self.powers * (K @ e), [self.theta * p_rate(P, F, K)]


class Fhgo1(Shgo):
    def __init__(self, theta: float, block: list[int], q: int, delta: float) -> None:
        super().__init__(theta, block, q)
        self.delta, self.block = delta, block

    def start(self, p: float = 1.0) -> list[Array]:
        return [p * np.eye(self.n), np.zeros((max(self.block) + 1, self.q))]

    def rates(self, F: Array, C: Array, e: Array, *rest: Array) -> tuple[Array, list[Array]]:
        P, eta = rest
        K = P @ C.T
        before = np.vstack([e / self.theta, eta[:-1]])  # theta A^T eta + C^T e, block by block
        deta = self.delta * self.theta * (-eta + self.theta * before)
        kappa = np.array([self.theta * K[i] @ eta[b] for i, b in enumerate(self.block)])
        return kappa, [self.theta * p_rate(P, F, K), deta]


class Fhgo2(Shgo):
    def __init__(self, theta: float, block: list[int], q: int, r: int) -> None:
        super().__init__(theta, block, q)
        self.r, self.b = r, np.array([math.comb(r, j) for j in range(1, r + 1)], dtype=float)

    def start(self, p: float = 1.0) -> list[Array]:
        return [p * np.eye(self.n), np.zeros((self.r, self.n)), np.zeros(self.r)]

    def rates(self, F: Array, C: Array, e: Array, *rest: Array) -> tuple[Array, list[Array]]:
        P, U, eta = rest
        K_n = P @ U[:1].T
        K_r = self.b + (U @ K_n)[:, 0]
        dU = np.vstack([U[1:], C]) - np.outer(self.b, U[0]) - U @ F
        deta = np.append(eta[1:], e) - K_r * eta[0]
        parts = [p_rate(P, F, K_n), dU, deta]
        return self.theta * self.powers * K_n[:, 0] * eta[0], [self.theta * part for part in parts]


def simulate(
    plant: Callable[[float, Array], Array],
    copy: Callable[[float, Array], Array],
    F: Callable[[float, Array], Array],
    C: Array,
    observer: Any,
    x: list[float],
    w: list[float],
    *,
    end: float,
    step: float,
    noise: Callable[[float], float],
    period: float = 0.0,
    delay: Callable[[float], float] = lambda t: 0.0,
    multiplicative: bool = False,
    p: float = 1.0,
) -> tuple[Array, list[tuple[Array, ...]]]:
    """(t, (x, w, P, ...)) at the steps, or at the samples; RK4 with equal steps between events."""
    q, n = C.shape
    parts = [np.array(x), np.array(w), *observer.start(p), np.zeros(q)]
    sizes = np.cumsum([part.size for part in parts])[:-1]
    shapes = [part.shape for part in parts]

    def split(z: Array) -> list[Array]:
        return [a.reshape(s) for a, s in zip(np.split(z, sizes), shapes, strict=True)]

    def measured(y: Array, t: float) -> Array:
        return y * (1 + noise(t)) if multiplicative else y + noise(t)

    held = np.zeros(q)

    def rates(t: float, z: Array) -> Array:
        x, w, *inner, alpha = split(z)
        e = held + alpha if period else C @ w - measured(C @ x[:n], t)
        kappa, others = observer.rates(F(t, w), C, e, *inner)
        return np.concatenate([plant(t, x), copy(t, w) - kappa, *map(np.ravel, others), -C @ kappa])

    arrivals = [period * k for k in range(round(end / period) + 1)] if period else []
    taken = [max(t - delay(t), 0.0) for t in arrivals]
    events = sorted({0.0, end, *arrivals, *taken})
    z = np.concatenate([part.ravel() for part in parts])
    times, states, at_event = [0.0], [z], {}
    for t, after in zip(events, [*events[1:], end], strict=True):
        at_event[t] = z
        if t in arrivals:
            x_s, w_s, *_, alpha_s = split(at_event[taken[arrivals.index(t)]])
            held = C @ w_s - alpha_s - measured(C @ x_s[:n], t)
        count = max(1, math.ceil((after - t) / step * (1 - 1e-9)))
        h = (after - t) / count
        for _ in range(count if after > t else 0):
            k1 = rates(t, z)
            k2 = rates(t + h / 2, z + h / 2 * k1)
            k3 = rates(t + h / 2, z + h / 2 * k2)
            k4 = rates(t + h, z + h * k3)
            z, t = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
            if not period:
                times.append(t)
                states.append(z)
        if after in arrivals and after > times[-1]:
            times.append(after)
            states.append(z)
    return np.array(times), [tuple(split(z)) for z in states]


def agrees(
    result: hgorun.Result,
    times: Array,
    states: list[tuple[Array, ...]],
    names: list[str],
    to_x: Any,
    tolerance: float,
) -> None:
    """x, xhat and the internal states at the points of the oracle, over their own size."""
    rows = np.array([int(np.argmin(np.abs(times - t))) for t in result.time])
    np.testing.assert_allclose(times[rows], result.time, atol=1e-9)
    found = [result.x, result.observers["o"].xhat, *(result.observers["o"].internal[name] for name in names)]
    expected = [np.array([states[i][j] for i in rows]) for j in range(len(found))]
    expected[1] = np.array([to_x(w) for w in expected[1]])
    for name, a, b in zip(["x", "xhat", *names], found, expected, strict=True):
        size = np.max(np.abs(b))
        np.testing.assert_allclose(a.reshape(b.shape), b, rtol=0, atol=tolerance * size, err_msg=name)


ACADEMIC = {
    "type": "academic",
    "initial": {"x1": 1, "x2": 1, "x3": 1},
    "disturbance": {"x3": "0.1*sin(0.1*t)"},
}
SINES = {"type": "sinusoids", "terms": [{"amplitude": 0.25, "omega": 387}, {"amplitude": 0.5, "omega": 987}]}


def academic_copy(t: float, x: Array) -> Array:
    phi = math.tanh(x[0] * x[1])
    return np.array(
        [
            math.sin(0.5 * t) * x[1] - 0.1 * x[0],
            math.sin(2.7 * t) * x[2] - 0.1 * x[1] + phi,
            -0.1 * x[2] + phi + 5 * math.sin(0.5 * math.pi * t),
        ]
    )


def academic(t: float, x: Array) -> Array:
    return academic_copy(t, x) + np.array([0, 0, 0.1 * math.sin(0.1 * t)])


def academic_F(t: float, x: Array) -> Array:
    return np.array([[0, math.sin(0.5 * t), 0], [0, 0, math.sin(2.7 * t)], [0, 0, 0]])


CHAIN = [0, 1, 2]
FAMILIES: dict[str, tuple[dict[str, Any], Callable[[float], Shgo], list[str]]] = {
    "shgo_riccati": ({"type": "shgo_riccati"}, lambda theta: Shgo(theta, CHAIN, 1), ["P"]),
    "fhgo1": ({"type": "fhgo1", "delta": 3}, lambda theta: Fhgo1(theta, CHAIN, 1, 3.0), ["P", "eta"]),
    "fhgo2_nuos r=1": (
        {"type": "fhgo2_nuos"},
        lambda theta: Fhgo2(theta, CHAIN, 1, 1),
        ["P", "U", "eta"],
    ),
    "fhgo2_nuos r=3": (
        {"type": "fhgo2_nuos", "r": 3},
        lambda theta: Fhgo2(theta, CHAIN, 1, 3),
        ["P", "U", "eta"],
    ),
}
SCENARIOS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "continuous": ({}, {}),
    "sampled": ({"sampling": {"period": 0.2}}, {"period": 0.2}),
    "sampled, delayed": (
        {"sampling": {"period": 0.2}, "delay": "0.1*abs(cos(t))"},
        {"period": 0.2, "delay": lambda t: 0.1 * abs(math.cos(t))},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("family", FAMILIES)
def test_academic_as_a_plain_simulator_has_it(family: str, scenario: str) -> None:
    block, make, names = FAMILIES[family]
    measurement, options = SCENARIOS[scenario]
    measurement = {**measurement, "noise": [SINES]}
    step = 0.001 if scenario == "continuous" else 0.005
    result = run(ACADEMIC, {**block, "theta": 3}, 4, step, measurement=measurement, output_step=0.2)
    times, states = simulate(
        academic,
        academic_copy,
        academic_F,
        np.eye(1, 3),
        make(3.0),
        [1, 1, 1],
        [0, 0, 0],
        end=4.0,
        step=step,
        noise=lambda t: 0.25 * math.sin(387 * t) + 0.5 * math.sin(987 * t),
        **options,
    )
    agrees(result, times, states, names, lambda w: w, 1e-9)


A_1, A_2, A_3 = 0.02, 4.18, 5.32
BOX = np.array([[0.5, 6], [0.2, 1], [1, 50]])


def dilution(t: float) -> float:
    return 1.71 * (1 + 0.6 * math.sin(6 * math.pi * t))


def phytoplankton(t: float, x: Array) -> Array:
    u, uptake = dilution(t), x[2] / (A_1 + x[2])
    return np.array(
        [
            A_2 * (1 - 1 / x[1]) * x[0] - u * x[0],
            A_3 * uptake - A_2 * (x[1] - 1),
            u * (1 - x[2]) - x[0] * uptake,
        ]
    )


def phytoplankton_F(t: float, z: Array) -> Array:
    s = np.clip(z, *BOX.T)
    return np.array([[0, -A_2 * s[0], 0], [0, 0, A_1 * A_3 * s[1] ** 2], [0, 0, 0]])


def phytoplankton_copy(t: float, z: Array) -> Array:
    """F(sat z) z + phi(u, sat z) with the F and phi that the thesis prints after (2.90)."""
    u, (z1, z2, z3) = dilution(t), np.clip(z, *BOX.T)
    phi = [
        (A_2 - u) * z1,
        A_2 * z2 - (A_2 + A_3) * z2**2,
        -A_1 * z1 * z3**3 + z3**2 * (z1 - u * (1 + A_1)) + u * z3,
    ]
    return phytoplankton_F(t, z) @ z + phi


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_phytoplankton_with_saturation_as_a_plain_simulator_has_it(family: str) -> None:
    block, make, names = FAMILIES[family]
    plant = {
        "type": "phytoplankton",
        "inputs": {"u": "1.71*(1 + 0.6*sin(6*pi*t))"},
        "initial": {"x1": 3, "x2": 1.7, "x3": 0.03},
    }
    observer = {
        **block,
        "theta": 5,
        "initial": {"x1": 2, "x2": 1.4, "x3": 0.1},
        "internal": {"P": 0.1},
        "saturation": {"z1": [0.5, 6], "z2": [0.2, 1], "z3": [1, 50]},
    }
    noise = {"type": "sinusoids", "terms": [{"amplitude": 0.05, "omega": 150}]}
    measurement = {"sampling": {"period": 0.02}, "noise": [noise], "mode": "multiplicative"}
    result = run(plant, observer, 1, 0.002, measurement=measurement, output_step=0.02)
    times, states = simulate(
        phytoplankton,
        phytoplankton_copy,
        phytoplankton_F,
        np.eye(1, 3),
        make(5.0),
        [3, 1.7, 0.03],
        [2, 1 / 1.4, 1 / 0.12],
        end=1.0,
        step=0.002,
        noise=lambda t: 0.05 * math.sin(150 * t),
        period=0.02,
        multiplicative=True,
        p=0.1,
    )
    w = np.array([state[1] for state in states])
    assert np.any((w < BOX[:, 0]) | (w > BOX[:, 1])), "nothing was saturated"
    agrees(result, times, states, names, lambda z: [z[0], 1 / z[1], 1 / z[2] - A_1], 1e-9)


# Two outputs; blocks of two, two and one state, coupled, in no order; F_k of time and state.
COUPLED = {
    "states": ["c", "a", "b", "d", "g"],
    "dynamics": {
        "a": "(1.5 + sin(t))*c + 0.3*d - a",
        "b": "cos(2*t)*d + 0.2*a*c - 0.5*b",
        "c": "(2 + cos(t) + 0.1*tanh(a))*g - 0.2*c",
        "d": "-sin(b) - 0.3*d + cos(3*t)*g",
        "g": "-0.3*g + sin(t) - 0.1*tanh(a*d)",
    },
    "output": ["b", "a"],
    "initial": {"a": 0.5, "b": -0.3, "c": 1, "d": 0.7, "g": -1},
}


def coupled(t: float, x: Array) -> Array:
    c, a, b, d, g = x
    return np.array(
        [
            (2 + math.cos(t) + 0.1 * math.tanh(a)) * g - 0.2 * c,
            (1.5 + math.sin(t)) * c + 0.3 * d - a,
            math.cos(2 * t) * d + 0.2 * a * c - 0.5 * b,
            -math.sin(b) - 0.3 * d + math.cos(3 * t) * g,
            -0.3 * g + math.sin(t) - 0.1 * math.tanh(a * d),
        ]
    )


def coupled_F(t: float, x: Array) -> Array:
    F = np.zeros((5, 5))
    F[0, 4] = 2 + math.cos(t) + 0.1 * math.tanh(x[1])
    F[1, 0], F[1, 3] = 1.5 + math.sin(t), 0.3
    F[2, 0], F[2, 3] = 0.2 * x[1], math.cos(2 * t)
    F[3, 4] = math.cos(3 * t)
    return F


@pytest.mark.slow
@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("family", ["shgo_riccati", "fhgo1"])
def test_two_outputs_as_a_plain_simulator_has_them(family: str, sampled: bool) -> None:
    block, _, names = FAMILIES[family]
    levels, C = [1, 0, 0, 1, 2], np.eye(5)[[2, 1]]
    oracle = Shgo(2.0, levels, 2) if family == "shgo_riccati" else Fhgo1(2.0, levels, 2, 3.0)
    noise = {"type": "sinusoids", "terms": [{"amplitude": 0.05, "omega": 20}]}
    measurement: dict[str, Any] = {"noise": [noise]}
    if sampled:
        measurement |= {"sampling": {"period": 0.1}, "delay": 0.05}
    options: dict[str, Any] = {"period": 0.1, "delay": lambda t: 0.05} if sampled else {}
    result = run(COUPLED, {**block, "theta": 2}, 3, 0.005, measurement=measurement)
    times, states = simulate(
        coupled,
        coupled,
        coupled_F,
        C,
        oracle,
        [1, 0.5, -0.3, 0.7, -1],
        [0] * 5,
        end=3.0,
        step=0.005,
        noise=lambda t: 0.05 * math.sin(20 * t),
        **options,
    )
    agrees(result, times, states, names, lambda w: w, 1e-9)


# ---- laws ----


@pytest.mark.costly
def test_lyapunov_and_riccati_form_of_the_gain_are_one() -> None:
    """Two discretisations of order four of one observer: their distance falls like h^4."""
    gaps = []
    for step in (0.004, 0.002, 0.001):
        one, two = (
            run(ACADEMIC, {"type": "shgo_riccati", "theta": 5, "equation": equation}, 10, step)
            for equation in ("riccati", "lyapunov")
        )
        gaps.append(np.max(np.abs(one.observers["o"].xhat - two.observers["o"].xhat)))
    P, S = one.observers["o"].internal["P"], two.observers["o"].internal["S"]
    np.testing.assert_allclose(P @ S, np.broadcast_to(np.eye(3), P.shape), atol=1e-4)
    assert np.polyfit(range(3), -np.log2(gaps), 1)[0] == pytest.approx(4, abs=0.2)
    assert gaps[-1] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 3, 5])
@pytest.mark.parametrize("equation", ["riccati", "lyapunov"])
def test_on_a_chain_the_gain_becomes_the_binomial_one(equation: str, n: int) -> None:
    plant = {
        "type": "integrator_chain",
        "n": n,
        "phi": "-x1",
        "initial": {f"x{i + 1}": 0.5 for i in range(n)},
    }
    result = run(plant, {"type": "shgo_riccati", "theta": 2, "equation": equation}, 30, 0.005)
    inner = result.observers["o"].internal
    P = inner["P"][-1] if equation == "riccati" else np.linalg.inv(inner["S"][-1])
    gain = P[:, 0]
    np.testing.assert_allclose(gain, [math.comb(n, k) for k in range(1, n + 1)], rtol=1e-9)


def test_on_a_chain_it_becomes_the_observer_of_constant_gain() -> None:
    """Started with the stationary P it is shgo from the start."""
    P = np.array([[3.0, 3, 1], [3, 5, 2], [1, 2, 1]])  # the inverse of S_ij = (-1)^(i+j) binomial(i+j-2, j-1)
    plant = {
        "type": "integrator_chain",
        "n": 3,
        "phi": "-sin(x1) - x3",
        "initial": {"x1": 1, "x2": 0, "x3": 0},
    }
    measurement = {"sampling": {"period": 0.1}, "delay": 0.05}
    block = {"type": "shgo_riccati", "theta": 2, "internal": {"P": P.tolist()}}
    one = run(plant, block, 5, 0.01, measurement=measurement)
    two = run(plant, {"type": "shgo", "theta": 2}, 5, 0.01, measurement=measurement)
    np.testing.assert_allclose(one.observers["o"].xhat, two.observers["o"].xhat, atol=1e-10)


FIRST = {"a": "(1.5 + sin(t))*b - a", "b": "2*g - 0.5*b", "g": "-g + sin(t) - 0.1*tanh(a)"}
SECOND = {"c": "cos(2*t)*d + 0.1*sin(c)", "d": "-0.3*d + cos(t)"}
VALUES = {"a": 0.5, "b": 0.6, "g": -0.4, "c": 0.7, "d": 0.8}


def inline(dynamics: dict[str, str], output: list[str] | str) -> dict[str, Any]:
    return {
        "states": list(dynamics),
        "dynamics": dynamics,
        "output": output,
        "initial": {name: VALUES[name] for name in dynamics},
    }


@pytest.mark.costly
@pytest.mark.parametrize(
    "block",
    [
        {"type": "shgo_riccati"},
        {"type": "shgo_riccati", "equation": "lyapunov"},
        {"type": "fhgo1", "delta": 3},
    ],
)
@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.1}, "delay": 0.05}])
def test_two_outputs_that_do_not_meet_are_two_single_ones(block: dict[str, Any], measurement: dict[str, Any]) -> None:
    """Chains of three and of two states: blocks of two, two and one."""
    block = {**block, "theta": 2}
    more = {"measurement": measurement}
    both = run(inline(FIRST | SECOND, ["a", "c"]), block, 4, 0.005, **more)
    together = both.observers["o"]
    for dynamics, columns, output in ((FIRST, slice(0, 3), 0), (SECOND, slice(3, 5), 1)):
        single = run(inline(dynamics, next(iter(dynamics))), block, 4, 0.005, **more)
        alone = single.observers["o"]
        np.testing.assert_allclose(together.xhat[:, columns], alone.xhat, atol=1e-12)
        if "eta" in alone.internal:
            found = together.internal["eta"][:, : len(dynamics), output]
            np.testing.assert_allclose(found, alone.internal["eta"], atol=1e-11)


@pytest.mark.parametrize("block", [{"type": "shgo_riccati"}, {"type": "fhgo1", "delta": 3}])
def test_a_list_of_one_output_is_one_output(block: dict[str, Any]) -> None:
    one, two = (run(inline(FIRST, output), {**block, "theta": 2}, 3, 0.01) for output in ("a", ["a"]))
    np.testing.assert_array_equal(one.observers["o"].xhat, two.observers["o"].xhat)


EVERY = [
    {"type": "shgo_riccati"},
    {"type": "shgo_riccati", "equation": "lyapunov"},
    {"type": "fhgo1", "delta": 3},
    {"type": "fhgo2_nuos", "r": 2},
    {"type": "fhgo2_nuos", "r": 1, "gain": "full"},
]


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("solver", [{"step": 0.01}, {"step": "auto"}, {"method": "dopri5", "step": "auto"}], ids=str)
@pytest.mark.parametrize("block", EVERY, ids=str)
@pytest.mark.parametrize("silence", [0.5, 1.0, 40])
def test_without_excitation_an_observer_is_flagged_or_finite(
    block: dict[str, Any], silence: float, solver: dict[str, Any]
) -> None:
    """P grows like exp(theta t) while x2 is not seen; afterwards the estimate is back, or given up."""
    dynamics = {"a": f"(1 - (t > 2)*(t < {2 + silence}))*b - 0.1*a", "b": "-a + tanh(b)"}
    measurement = {"sampling": {"period": 0.1}, "delay": 0.05}
    more = {"solver": solver, "measurement": measurement}
    result = run(inline(dynamics, "a"), {**block, "theta": 10}, 45, 0.01, **more)
    observer = result.observers["o"]
    if not observer.lost:
        np.testing.assert_allclose(observer.xhat[-1], result.x[-1], atol=1e-6)
    else:
        assert silence > 0.5
        assert observer.status_at is not None
        assert observer.status_at > 2
        before = result.time < observer.status_at - 0.1
        assert np.all(np.isfinite(observer.xhat[before]))
        assert np.all(np.isnan(observer.xhat[result.time > observer.status_at]))
    if silence == 40:
        assert observer.lost


@pytest.mark.costly
@pytest.mark.parametrize("delay", ["0.05", "0.05 + 0.04*sin(t)"])
@pytest.mark.parametrize("block", EVERY, ids=str)
def test_a_late_continuous_output_is_no_obstacle(block: dict[str, Any], delay: str) -> None:
    """Without noise and disturbance the estimate converges."""
    result = run(inline(FIRST, "a"), {**block, "theta": 2}, 20, 0.005, measurement={"delay": delay})
    np.testing.assert_allclose(result.observers["o"].xhat[-1], result.x[-1], atol=1e-4)


@pytest.mark.parametrize(
    ("more", "key", "words"),
    [
        ({"theta": 0}, "theta", "a number above 0"),
        ({"equation": "both"}, "equation", "lyapunov"),
        ({"coordinates": "canonical"}, "coordinates", "triangular"),
        ({"internal": {"P": -1}}, "internal.P", "positive definite"),
        ({"internal": {"P": [1, 2]}}, "internal.P", "3 rows of 3"),
        ({"internal": {"P": [1, 2, 0, 2, 1, 0, 0, 0, 1]}}, "internal.P", "smallest eigenvalue is -1"),
        ({"internal": {"S": 1}}, "internal", "unknown internal state 'S'"),
    ],
)
def test_wrong_input_is_refused(more: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        run(ACADEMIC, {"type": "shgo_riccati", "theta": 2, **more}, 1, 0.01)
    assert error.value.key == f"observers.o.{key}"


@pytest.mark.parametrize("output", ["a + b", "2*a"])
def test_an_output_that_is_no_state_is_refused(output: str) -> None:
    with pytest.raises(ConfigError, match="not one of the states") as error:
        run(inline(FIRST, output), {"type": "shgo_riccati", "theta": 2}, 1, 0.01)
    assert error.value.key == "plant"
