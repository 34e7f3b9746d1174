"""The bioreactor of Gauthier, Hammouri and Othman: Contois growth with the dilution as input."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import casadi as ca

from hgorun.plants.base import Plant, Quantity, plant


@plant("bioreactor_gauthier")
class GauthierBioreactor(Plant):
    """Micro-organisms eta1 growing on a substrate eta2, with dilution rate u.

        eta1' =  g - u eta1
        eta2' = -g + u (s_in - eta2),    g = mu eta1 eta2 / (k_c eta1 + eta2),    y = eta1

    Observers for triangular plants compute in x = (eta1, g), where x1' = x2 - u x1, x2' is (22), and
    eta2 = k_c x1 x2 / (mu x1 - x2). The paper has mu = 3, k_c = 1, s_in = 0.1. Its initial state
    (0.05, 0.05) lies on the border of the set X that it calls invariant, not in X: eta1 + eta2 = s_in
    stays so for all time. gamma(y) = 4y, said to bound the slope of (22) as (6) asks, does not.
    """

    reference = "Meiners, Adamy 2025, (21)-(22)"
    valid = "eta1 > 0, eta2 > 0, eta1 + eta2 <= s_in"
    known_parameters = {
        "mu": Quantity(3.0, "1/s", "maximal growth rate"),
        "k_c": Quantity(1.0, "", "Contois constant"),
        "s_in": Quantity(0.1, "", "substrate in the feed"),
    }
    known_inputs = {"u": Quantity(None, "1/s", "dilution rate")}

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("eta1", "eta2")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("eta1",)

    def equations(self, t: ca.SX, x: SimpleNamespace, u: SimpleNamespace, p: SimpleNamespace) -> tuple[Any, Any]:
        g = p.mu * x.eta1 * x.eta2 / (p.k_c * x.eta1 + x.eta2)
        return [g - u.u * x.eta1, -g + u.u * (p.s_in - x.eta2)], [x.eta1]

    @property
    def triangular_coordinates(
        self,
    ) -> tuple[Callable[[ca.SX, ca.SX], ca.SX], Callable[[ca.SX, ca.SX], ca.SX]]:
        def there(eta: ca.SX, p: ca.SX) -> ca.SX:
            return ca.vertcat(eta[0], p[0] * eta[0] * eta[1] / (p[1] * eta[0] + eta[1]))

        return there, self.inverse

    @property
    def inverse(self) -> Callable[[ca.SX, ca.SX], ca.SX]:
        def eta_of(x: ca.SX, p: ca.SX) -> ca.SX:
            return ca.vertcat(x[0], p[1] * x[0] * x[1] / (p[0] * x[0] - x[1]))

        return eta_of
