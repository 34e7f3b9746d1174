"""The low-power high-gain observer of Astolfi and Marconi."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number, Positive
from hgorun.errors import NotObservableForm, Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import LocallyLinear
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.observers.nested import clipped
from hgorun.observers.treangle import cascade, characteristic
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import A
from hgorun.symbolic.observability import CanonicalForms
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@dataclass(frozen=True)
class PhaseVariableForms(CanonicalForms):
    """Plants with one output whose z_i' is z_(i+1) alone, i < n, n >= 2."""

    def __call__(self, plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
        """The canonical form.

        Raises
        ------
        NotObservableForm
            When the plant is not in this class; the message says why.
        """
        if len(plant.outputs) > 1:
            raise NotObservableForm(f"low_power takes one output, found {', '.join(plant.outputs)}")
        if plant.n < 2:
            raise NotObservableForm("low_power is n - 1 blocks of two states and needs n >= 2, found n = 1")
        form = super().__call__(plant, at, parameters)
        found = _further_term(form)
        if found is not None and form.map == "chain" and self.map == "auto":
            with suppress(NotObservableForm):
                form = replace(self, map="derivatives")(plant, at, parameters)
                found = _further_term(form) and found
        if found is not None:
            raise NotObservableForm(
                "low_power needs phi in the last equation only, z_i' = z_(i+1) for i < n, z the output and "
                f"its derivatives; here the derivative of {found} has a further term"
            )
        return form


def _further_term(form: CanonicalForm) -> str | None:
    """The first z_i before the last whose derivative is not z_(i+1) alone."""
    plant = form.plant
    for i in range(plant.n - 1):
        rate = ca.jtimes(form.phi_map[i], plant.x, plant.dynamics)
        if form.map == "chain":
            alone = ca.simplify(rate - form.phi_map[i + 1]).is_zero()
        else:  # z_(i+1) is z_i' with the inputs at zero
            alone = not ca.depends_on(rate, plant.u)
        if not alone:
            return f"the state {plant.states[i]}" if form.identity else f"z{i + 1}"
    return None


def _upper(s: Symbols) -> ca.SX:
    """xi_12, ..., xi_(n-1,2)."""
    return ca.vertcat(s.xhat[1:-1] + s.e, s.xhat[-1]) if "e" in vars(s) else s.xhat[-1]


@observer("low_power")
class LowPowerObserver(LocallyLinear, Extendable, ConstantGain):
    """Low-power high-gain observer: n - 1 blocks of two states, theta to the power 2 at most.

    For plants with one output and phi in the last equation alone, x_i' = x_(i+1), x_n' = phi(u, x), n >= 2,
    or models that are so in z = (h, L_f h, ..., L_f^(n-1) h). Block i, xi_i in R^2, observes (x_i, x_(i+1)):

        xi_i'     = A_2 xi_i + diag(0, 1) xi_(i+1) + diag(theta, theta^2) k_i e_i,            i <= n - 2
        xi_(n-1)' = A_2 xi_(n-1) + B_2 phi^s(u, xhat) + diag(theta, theta^2) k_(n-1) e_(n-1)
        e_1 = y - xi_11,  e_i = xi_(i-1,2) - xi_i1,    xhat = (xi_11, xi_21, ..., xi_(n-1,1), xi_(n-1,2))

    The 2n - 2 poles are any stable set; the error decays at theta times their value. ``gains`` are
    (k_11, k_12, k_21, k_22, ...), with the error's matrix Hurwitz. n = 2 is the standard observer. The
    internal state ``e`` is (e_2..e_(n-1)): zero where the blocks start from one estimate.

    Noise of high frequency omega reaches component i like 1/omega^min(i, n-1), and if phi depends on x_1,
    like 1/omega^min(i, n-1, n+2-i). Choose it for long chains, where theta^n in the standard observer is
    out of range; treangle filters x_1 too.

    ``saturate: [M_1, ..., M_(n-1)]`` is the peaking-free form, M_i a bound of |x_(i+1)| (twice its largest value, say):
    with sat_i the saturation at M_i,

        xi_i1' = xi_i2 + theta k_i1 e_i,    xi_i2' = sat_(i+1)(xi_(i+1,2)) + theta^2 k_i2 e_i,    i <= n - 2
        e_i = sat_(i-1)(xi_(i-1,2)) - xi_i1,    xhat = (xi_11, xi_21, ..., xi_(n-1,1), sat_(n-1)(xi_(n-1,2)))

    Each block but the first filters a bounded signal at the rate theta, so no component of xhat peaks; the internal
    xi_i2 peak like theta. It converges, as its authors prove, if M_i > sup |x_(i+1)|; that the peaks are bounded has
    been derived again here, the convergence has not. It computes in z, where the saturations act, and needs the
    inverse of the map for plants that are not chains. With no saturation active it is the linear observer to the last
    bit.

    Astolfi, Marconi, Praly and Teel 2016 expect an exponent above 1 for every component after the first; it
    is so for the outputs above, and not for (xi_11, xi_12, xi_22, ...), where the second has 1.
    """

    reference = "Astolfi, Marconi 2015"
    key_references = {"saturate": "Astolfi, Marconi, Praly, Teel 2018, quoted from memory"}
    form = PhaseVariableForms()

    gains: tuple[Number, ...] | None = Field(default=None, description="k_11, k_12, k_21, k_22, ..., instead of poles")
    saturate: tuple[Positive, ...] | None = Field(
        default=None, description="bounds M of |x_2|..|x_n|, n - 1 numbers > 0: no component of the estimate peaks"
    )

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        numbers = {"theta": np.array(self.theta), "K": self._blocks(form)}
        if self.saturate is None:
            return numbers
        n = form.plant.n
        if len(self.saturate) != n - 1:
            raise Problem(("saturate",), f"expected {n - 1} bounds, of x_2..x_{n}; found {len(self.saturate)}")
        return {**numbers, "M": np.array(self.saturate)}

    @property
    def canonical(self) -> bool:
        return self.saturate is not None or super().canonical

    @property
    def nonlinear(self) -> str | None:
        return None if self.saturate is None else "a saturation is active while |xi_i2| > M_i"

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        return ca.fabs(_upper(s)) >= k.M

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        last = s.xhat[-1]
        return ca.vertcat(s.xhat[:-1], clipped(last, k.M[-1]) if "M" in vars(k) else last)

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray | Symmetric]:
        return {"e": np.zeros(form.plant.n - 2)} if form.plant.n > 2 else {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        # xi_(i,2) = xi_(i+1,1) + e_(i+1), so (xhat, e_2..e_(n-1)) is xi in other coordinates, and in
        # e_i' = xi_(i-1,2)' - xi_i1' both have xi_i2: e is driven by itself and the innovation alone, and
        # xhat' is the plant's copy minus a correction kappa, as in any other observer.
        shift = A(plant.n - 1)
        excess = self._excess(plant.n, s, k)  # xi_i2 - sat(xi_i2), zero where nothing is saturated
        apart = ca.vertcat(-e, s.e) if plant.n > 2 else -e  # e_i as if nothing were
        errors = ca.vertcat(apart[0], *[apart[i + 1] - excess[i] for i in range(plant.n - 2)])
        first = k.theta * k.K[:, 0] * errors
        second = k.theta**2 * k.K[:, 1] * errors
        kappa = -ca.vertcat(first + shift @ apart, second[-1])
        copy = plant.copy(s.xhat)
        if "M" in vars(k):
            copy = ca.vertcat(copy[:-1], plant.copy(self.estimate(s, k))[-1])
        derivatives = {"xhat": copy - plant.lift(s.xhat, kappa)}
        if plant.n > 2:
            derivatives["e"] = (shift.T @ second - first)[1:] - excess[1:]
        return Flow(derivatives, correction=-first[0])  # xi_12, not xi_21, is x_2 in the equation of xi_11

    def _excess(self, n: int, s: Symbols, k: Symbols) -> ca.SX:
        """xi_i2 - sat_i(xi_i2), shape (n - 1,)."""
        if "M" not in vars(k):
            return ca.SX(n - 1, 1)
        return _upper(s) - clipped(_upper(s), k.M)

    def characteristics(self, form: CanonicalForm) -> list[np.ndarray]:
        K = self._blocks(form)
        return [characteristic(K[:, 0], np.cumprod(K[:, 1]))]

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self.theta * float(np.max(np.abs(np.roots(*self.characteristics(form)))))

    def _blocks(self, form: CanonicalForm) -> np.ndarray:
        """k_1..k_(n-1), shape (n - 1, 2).

        The characteristic polynomial is r_(n-1), r_0 = 1, r_i = s (s + k_i1) r_(i-1) + k_12 ... k_i2.
        """
        numbers = self.gain(2 * form.plant.n - 2)
        if self.gains is not None:
            return numbers.reshape(-1, 2)
        d, c = cascade(np.array([1.0, *numbers]))
        return np.column_stack([d, c / np.append(1.0, c[:-1])])
