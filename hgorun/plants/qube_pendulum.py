"""The rotary pendulum of Furuta as built by Quanser: Qube-Servo 2."""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from hgorun.plants.base import Expressions, Input, Parameter, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("qube_pendulum")
class QubePendulum(Plant):
    """Arm angle theta, turned by a motor with voltage V, and pendulum angle alpha, both measured.

        [ J_r + m_p (L_r^2 + L_p^2/4 sin^2 alpha)    -m_p L_p L_r/2 cos alpha ] [theta'']
        [ -m_p L_p L_r/2 cos alpha                    J_p + m_p L_p^2/4       ] [alpha'']

          = [ tau - D_r theta' - m_p L_p^2/4 sin(2 alpha) theta' alpha' - m_p L_p L_r/2 sin(alpha) alpha'^2 ]
            [ -D_p alpha' + m_p L_p^2/8 sin(2 alpha) theta'^2 + m_p g L_p/2 sin alpha                       ]

    alpha = 0 upright, +-pi hanging, known up to whole turns; J_r = m_r L_r^2/12, J_p = m_p L_p^2/12 (rods),
    tau = -k_m (V - k_m theta')/R_m. The defaults are identified on one machine; its D_p is negative. In the sign
    convention of their authors the electromotive force k_m theta' drives the arm instead of braking it;
    k_m^2/R_m = 7e-6 N m s/rad is 1.4 % of D_r, which hides it.
    """

    reference = "Quanser Qube-Servo 2; parameters: Centre Automatique et Systemes, Mines ParisTech, 2022"
    valid = "everywhere"
    known_parameters = {
        "k_m": Parameter(0.01, "V s/rad", "motor constant"),
        "R_m": Parameter(14.0, "Ohm", "resistance of the motor"),
        "m_r": Parameter(0.095, "kg", "mass of the arm"),
        "L_r": Parameter(0.085, "m", "length of the arm"),
        "m_p": Parameter(0.024, "kg", "mass of the pendulum"),
        "L_p": Parameter(0.129, "m", "length of the pendulum"),
        "D_r": Parameter(5e-4, "N m s/rad", "friction of the arm"),
        "D_p": Parameter(-3e-5, "N m s/rad", "friction of the pendulum"),
        "g": Parameter(9.81, "m/s^2", "gravity"),
    }
    known_inputs = {"V": Input("V", "voltage of the motor")}
    units = {"theta": "rad", "alpha": "rad", "theta_dot": "rad/s", "alpha_dot": "rad/s"}
    first = Start(
        end=6,
        initial={"theta": 0, "alpha": 2.4, "theta_dot": 0, "alpha_dot": 0},
        estimate={"theta": 0.1, "alpha": 2.3, "theta_dot": 1, "alpha_dot": -1},
        inputs={"V": "3*sin(3*t) + 2*sin(5.3*t)"},
        period=0.01,
        noise=0.005,
        observers={"SHGO": {"type": "shgo", "theta": 20}, "FHGO": {"type": "fhgo2", "theta": 30, "r": 1}},
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("theta", "alpha", "theta_dot", "alpha_dot")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("theta", "alpha")

    @property
    def periods(self) -> Mapping[str, float]:
        return {"alpha": 2 * math.pi}

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        sin, cos, sin2 = ca.sin(x.alpha), ca.cos(x.alpha), ca.sin(2 * x.alpha)
        half = p.L_p / 2  # the centre of mass
        coupling = p.m_p * half * p.L_r
        tau = -p.k_m * (u.V - p.k_m * x.theta_dot) / p.R_m
        m_11 = p.m_r * p.L_r**2 / 12 + p.m_p * (p.L_r**2 + half**2 * sin**2)
        m_12 = -coupling * cos
        m_22 = p.m_p * p.L_p**2 / 12 + p.m_p * half**2
        r_1 = tau - p.D_r * x.theta_dot - coupling * sin * x.alpha_dot**2
        r_1 -= p.m_p * half**2 * sin2 * x.theta_dot * x.alpha_dot
        r_2 = p.m_p * half**2 / 2 * sin2 * x.theta_dot**2 + p.m_p * p.g * half * sin - p.D_p * x.alpha_dot
        den = m_11 * m_22 - m_12**2
        theta_2 = (m_22 * r_1 - m_12 * r_2) / den
        alpha_2 = (m_11 * r_2 - m_12 * r_1) / den
        return [x.theta_dot, x.alpha_dot, theta_2, alpha_2], [x.theta, x.alpha]
