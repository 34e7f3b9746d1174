"""The filtered high-gain observer FHGO I: a filter as long as the plant."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import FilterCascade
from hgorun.observers.riccati import RiccatiGain, riccati
from hgorun.symbolic.matrices import A, C
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm


@observer("fhgo1")
class FilteredObserver1(FilterCascade, RiccatiGain):
    """Filtered high-gain observer with a filter as long as the plant (FHGO I), for triangular plants.

    For triangular plants that need not be uniformly observable, with one or several outputs: x = (x^(1), ..., x^(q)),
    y = x^(1) = C x in R^(n_1), and F = F(u, xhat) has the blocks d f^(k) / d x^(k+1) on its superdiagonal. The
    innovation e passes through a chain of q first-order filters, and block k is corrected with the output of the k-th
    one,

        xhat' = F xhat + phi(u, xhat) - theta K(t) eta,         K = diag(K^(1), ..., K^(q))
        eta'  = delta theta (-eta + theta A_q^T eta + C_q^T e),   eta(0) = 0
        P'    = theta (P + F P + P F^T - P C^T C P),            P(0) = I

    where K^(k), n_k x n_1, is the k-th block of P C^T. ``eta`` is kept as a q x n_1 array, eta^(k) in row k.
    No power of theta above 2 appears; the noise reaches component i through i filters.

    theta >= 1 sets the speed, delta > 0 the bandwidth delta theta of the filters. On a chain A_n with
    stationary P the error has the characteristic polynomial (s^2 + delta s + delta)^n at theta = 1: stable
    for every delta > 0, all poles at -2 theta for delta = 4, lightly damped for small delta, and for large
    delta the standard observer (shgo_riccati), with its noise. fhgo2_nuos filters the first component more
    strongly, with a filter of any order.

    With sampled outputs (2.75) prints two expressions for alpha', equal only for delta = 1; the first, -theta K^(1)
    eta^(1) without delta, is what xhat_1 is corrected with, and with the second the observer diverges at sampling
    periods for which it converges with the first one. (2.36) prints C_qn for the q n_1 columns of C_q.
    """

    reference = "Robles Magdaleno 2023, (2.36)-(2.39), (2.75)"

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"theta": 2.0, "delta": 3.0}

    def design(self, form: TriangularForm) -> dict[str, np.ndarray]:
        self.require_fit(self.states(form))
        return {"theta": np.array(self.theta), "delta": np.array(self.delta)}

    def states(self, form: TriangularForm) -> dict[str, np.ndarray | Symmetric]:
        q = max(form.block) + 1
        return {"eta": np.zeros((q, len(form.measured))), "P": Symmetric(np.eye(form.n))}

    def equations(self, plant: TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        F, q = plant.F(s.xhat), s.eta.shape[0]
        K = s.P @ plant.C.T
        kappa = k.theta * ca.sum2(K * s.eta[list(plant.form.block), :])
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - kappa,
                "eta": k.delta * k.theta * (-s.eta + k.theta * A(q).T @ s.eta + C(q).T @ e.T),
                "P": k.theta * riccati(s.P, F, plant.C),
            },
            correction=plant.measured(kappa),
        )

    def nominal_poles(self, order: int) -> np.ndarray:
        return np.resize(np.roots([1.0, self.delta, self.delta]), order)

    @property
    def settling_rate(self) -> float:
        return self.theta * min(1.0, self.delta)

    def fastest_rate(self, form: TriangularForm) -> float:
        filters = self.theta * float(np.max(np.abs(np.roots([1.0, self.delta, self.delta]))))
        return max(filters, self.rate(max(form.block) + 1))
