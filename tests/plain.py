"""Observers written in plain numpy, run beside a plant, and the linear error dynamics of those that are compiled.

The oracle of observers that are one ordinary differential equation for w, the estimate and what the observer has
more; naive.py knows the high-gain observers of the thesis only, and steps that are not commensurate with events.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import examples
import numpy as np
from examples import VAN_DER_POL, Block, chain, sinusoid

import hgorun
from hgorun import Experiment
from hgorun.result.records.observer import ObserverResult
from hgorun.simulation.simulate import prepare

Array = np.ndarray
STEP, END = 0.01, 3.0
SCENARIOS: dict[str, dict[str, float]] = {
    "continuous": {},
    "sampled": {"period": 0.2},
    "sampled late": {"period": 0.2, "delay": 0.13},
    "late": {"delay": 0.17},
}


def experiment(plant: Block, observers: dict[str, Block], **more: Any) -> Experiment:
    """On the grid of the plain simulator."""
    return examples.experiment(plant, observers, **{"end": END, "output_step": STEP, "step": STEP, **more})


def measured(period: float | None = None, delay: float = 0.0) -> Block:
    return {"noise": sinusoid(0.1, 3, 0.5), "delay": delay, **({"sampling": {"period": period}} if period else {})}


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


def error_dynamics(plant: Block, block: Block) -> tuple[Array, Array]:
    """M, b of w' = M w + b v near x = 0, from the flow that is compiled; w = (xhat, internal)."""
    run = prepare(experiment(plant, {"o": block}))
    flow = run.structure.system.regimes[0].flow
    t, p, z, w = (ca.SX.sym(name, flow.size_in(i)) for i, name in enumerate("tpzw"))
    jacobian = ca.Function("J", [t, p, z, w], [ca.jacobian(flow(t, p, z, w), z)])
    J = np.asarray(jacobian(0, run.numbers.p, np.zeros(z.shape), np.zeros(w.shape)).full())
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
    rows, held = [z], 0.0
    s_y: list[Array] = []
    slopes: list[Array] = []

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
    "van der pol": (van_der_pol, VAN_DER_POL | {"initial": {"x1": 0.5, "x2": 0.5}}),
}
START = np.array([0.2, -0.1, 0.3])


def run_both(
    block: Block,
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
