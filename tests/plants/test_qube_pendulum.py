"""The rotary pendulum against the equations of its authors and a Lagrangian derivation."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.plants.qube_pendulum import QubePendulum

DEFAULTS = {name: q.default or 0.0 for name, q in QubePendulum.known_parameters.items()}


def plant(**parameters: float) -> BuiltPlant:
    initial = {"theta": 0, "alpha": 0.1, "theta_dot": 0, "alpha_dot": 0}
    return build_plant(
        QubePendulum.model_validate(
            {"type": "qube_pendulum", "parameters": parameters, "inputs": {"V": 0}, "initial": initial}
        )
    )


def rates(built: BuiltPlant, x: Any, V: float = 0.0) -> np.ndarray:
    found = built.model.f(0, ca.DM(x), ca.DM(V), ca.DM(built.parameters))
    return np.asarray(found.full()).ravel()


def published(x: np.ndarray, V: float) -> np.ndarray:
    """theta'' and alpha'' in the form in which the data's authors give them."""
    p = DEFAULTS
    _, al, td, ad = x
    mp, Lp, Lr, g = p["m_p"], p["L_p"], p["L_r"], p["g"]
    Jr, Jp = p["m_r"] * Lr**2 / 12, mp * Lp**2 / 12
    tau = -p["k_m"] * (V - p["k_m"] * td) / p["R_m"]
    s, c, s2 = np.sin(al), np.cos(al), np.sin(2 * al)
    arm = 4 * Jr + Lp**2 * mp * s**2 + 4 * Lr**2 * mp
    den = 4 * Lp**2 * Lr**2 * mp**2 * c**2 - (4 * Jp + Lp**2 * mp) * arm
    a = -8 * p["D_p"] * ad + Lp**2 * mp * td**2 * s2 + 4 * Lp * g * mp * s
    b = 4 * p["D_r"] * td + Lp**2 * mp * ad * td * s2 + 2 * Lp * Lr * mp * ad**2 * s - 4 * tau
    return np.array([
        (-Lp * Lr * mp * a * c + (4 * Jp + Lp**2 * mp) * b) / den,
        (2 * Lp * Lr * mp * b * c - arm * a / 2) / den,
    ])  # fmt: skip


def energies(q: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Kinetic and potential energy: the pendulum's centre at L_p/2, tilted across the arm."""
    p = DEFAULTS
    theta, alpha = q[0], q[1]
    radial, tangential = (
        ca.vertcat(ca.cos(theta), ca.sin(theta), 0),
        ca.vertcat(-ca.sin(theta), ca.cos(theta), 0),
    )
    half = p["L_p"] / 2
    centre = p["L_r"] * radial - half * ca.sin(alpha) * tangential + half * ca.cos(alpha) * ca.vertcat(0, 0, 1)
    speed = ca.jtimes(centre, q, v)
    rods = p["m_r"] * p["L_r"] ** 2 / 12 * v[0] ** 2 + p["m_p"] * p["L_p"] ** 2 / 12 * v[1] ** 2
    return (rods + p["m_p"] * ca.dot(speed, speed)) / 2, p["m_p"] * p["g"] * centre[2]


def test_equations_as_published() -> None:
    for *x, V in np.random.default_rng(0).normal(size=(20, 5)) * [1, 2, 5, 5, 3]:
        found = rates(plant(), x, V)
        np.testing.assert_allclose(found[2:], published(np.array(x), V), rtol=1e-12)
        np.testing.assert_array_equal(found[:2], x[2:])


def test_equations_from_the_lagrangian() -> None:
    """d/dt dL/dv - dL/dq = generalised forces, with the accelerations of the plant put in."""
    q, v, acceleration = (ca.SX.sym(n, 2) for n in ("q", "v", "a"))
    kinetic, potential = energies(q, v)
    momentum = ca.gradient(kinetic, v)
    left = ca.jtimes(momentum, q, v) + ca.jtimes(momentum, v, acceleration) - ca.gradient(kinetic - potential, q)
    balance = ca.Function("balance", [q, v, acceleration], [left])
    p = DEFAULTS
    for *x, V in np.random.default_rng(1).normal(size=(20, 5)) * [1, 2, 5, 5, 3]:
        found = rates(plant(), x, V)
        tau = -p["k_m"] * (V - p["k_m"] * x[2]) / p["R_m"]
        forces = [tau - p["D_r"] * x[2], -p["D_p"] * x[3]]
        np.testing.assert_allclose(np.asarray(balance(x[:2], x[2:], found[2:])).ravel(), forces, atol=1e-12)


@pytest.mark.parametrize("D_p", [0.0, 3e-5])
def test_energy_decays_without_voltage(D_p: float) -> None:
    """E' = -(D_r - k_m^2/R_m) theta'^2 - D_p alpha'^2; with the negative D_p identified it can grow."""
    q, v = ca.SX.sym("q", 2), ca.SX.sym("v", 2)
    kinetic, potential = energies(q, v)
    energy = ca.Function("E", [q, v], [ca.gradient(kinetic + potential, ca.vertcat(q, v))])
    built = plant(D_p=D_p)
    for x in np.random.default_rng(2).normal(size=(20, 4)) * [1, 2, 5, 5]:
        slope = energy(x[:2], x[2:])
        power = float(ca.dot(slope, ca.DM(rates(built, x))))
        assert power == pytest.approx(-(5e-4 - 1e-4 / 14) * x[2] ** 2 - D_p * x[3] ** 2, abs=1e-12)
        assert power < 0


def test_hanging_at_rest_is_a_stable_equilibrium() -> None:
    """Of the four eigenvalues the one of the arm's angle is 0; the pendulum swings at 16 rad/s."""
    hanging = [0.3, np.pi, 0, 0]
    np.testing.assert_allclose(rates(plant(), hanging), 0, atol=1e-12)
    model = plant().model
    jacobian = ca.Function("A", [model.t, model.x, model.u, model.p], [ca.jacobian(model.dynamics, model.x)])
    A = np.asarray(jacobian(0, hanging, 0, list(DEFAULTS.values())).full())
    values = sorted(np.linalg.eigvals(A), key=abs)
    assert abs(values[0]) < 1e-9
    assert max(v.real for v in values[1:]) < -1
    assert abs(values[-1].imag) == pytest.approx(15.95, abs=0.01)


def test_upright_is_unstable() -> None:
    np.testing.assert_allclose(rates(plant(), [0, 0, 0, 0]), 0, atol=1e-12)
    assert rates(plant(), [0, 0.01, 0, 0])[3] > 0
