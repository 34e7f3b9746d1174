"""The adaptive high-gain observer, which estimates constant parameters as well."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import ExpressionText, Name, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.expressions import of_copy, require_known, require_states
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols

_LARGEST = 1e6  # p_max over P(0)
_CEASING = 0.1  # of p_max: where forgetting ceases by and by


@observer("adaptive")
class AdaptiveObserver(ConstantGain):
    """Adaptive high-gain observer, for uniformly observable plants with constant parameters that are not known.

    The plant is x' = f(u, x) + Psi(t, u, x) rho with q unknown constants rho: f is the model of the configuration, and
    Psi rho is what it leaves out (``disturbance`` of a simulated plant). In the coordinates of the chain, with e the
    innovation and C the first components of the chains,

        Upsilon' = theta (A - G C) Upsilon + Delta(theta) Psi(t, xhat),             Upsilon(0) = 0
        P'       = theta (m(P) P - P Upsilon^T C^T C Upsilon P),                   P(0) = p I
        rho^'    = -theta P Upsilon^T C^T e
        xhat'    = f(xhat) + Psi rho^ - theta Delta^-1 G e + Delta^-1 Upsilon rho^'

    and in the plant's own coordinates J Psi for Psi, and J^-1 before the corrections. A - G C has the given poles.

    With eta = Delta (xhat - x) - Upsilon (rho^ - rho), eta' = theta (A - G C) eta but for differences of f and Psi in
    x, exactly, and (rho^ - rho)' = -theta P Upsilon^T C^T C (Upsilon (rho^ - rho) + eta): both decay if the integral of
    Upsilon^T C^T C Upsilon over every window of some length is at least c I, c > 0 (persistent excitation). P is
    least squares over all the past, whose weight falls as exp(-theta) per time, so that slow changes of rho are
    followed; ``analyze`` says how well the parameters were excited. In a direction that nothing excites P grows as
    exp(theta t), up to ``p_max``: m(P) = clip(10 (1 - trace P/p_max), 0, 1) is 1 up to nine tenths of it, and 0 at
    p_max, which the trace does not exceed. ``internal: {P: 0}`` never adapts: ``shgo`` with the parameters ``internal:
    {rho: ...}``.

    Noise reaches x_i with theta^i, and rho with theta^(n+1) where Psi is in the last equation. Several outputs have
    one Upsilon, P and rho between them. If only the place of the missing term is known, take ``extended``, which
    needs no excitation and follows one unknown function for each output; take this observer if the term is a sum of
    known functions, which it then estimates without lag. Sampled and late outputs enter by the common innovation;
    there is no theorem for them.

    Derived here (the identity for eta is a law in the tests), after the structure of the publication, which was not
    at hand; that forgetting stops gradually near p_max, and P can fall from there, is our own.
    """

    lacks = {"extend": "an unknown input could not be told from the unknown constants of Psi: take one of the two"}

    reference = "Farza, M'Saad, Maatoug, Kamoun 2009"

    Psi: dict[Name, tuple[ExpressionText, ...]] = Field(
        min_length=1,
        description="state: q expressions of t, inputs, parameters, states (their estimates) and outputs (y, where "
        "there is one, or their names), a row of Psi; states left out have zeros",
    )
    p_max: Positive | None = Field(
        default=None,
        description="what the trace of P does not exceed, > 0; 1e6 times the largest of P(0) by default",
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0, "Psi": {states[-1]: ["1"]}}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if not form.square:
            raise Problem(
                ("type",),
                "outputs that measure the same have more chain components than there are states, and Upsilon a row for "
                "each component: leave out the outputs that are not needed",
            )
        require_states("Psi", self.Psi, form.plant.states)
        for name, row in self.Psi.items():
            if len(row) != self.count:
                first = next(iter(self.Psi))
                message = f"expected {self.count} expressions, one a parameter, as for {first}; found {len(row)}"
                raise Problem(("Psi", name), message)
            for i, text in enumerate(row):
                require_known(("Psi", name, i), text, _names(form))
        _, G = self.chain_gains(form)
        start = self._start_of_P()
        if np.min(np.linalg.eigvalsh(start)) < 0:
            raise Problem(("internal", "P"), "expected a symmetric matrix without negative eigenvalues")
        p_max = _LARGEST * (float(np.max(np.diag(start))) or 1.0) if self.p_max is None else self.p_max
        if np.trace(start) > p_max:
            message = f"expected no less than the trace of P(0), {np.trace(start):g}; found {p_max:g}"
            raise Problem(("p_max",), message)
        return {"theta": np.array(self.theta), "G": G, "p_max": np.array(p_max)}

    @property
    def count(self) -> int:
        """q, the number of parameters."""
        return len(next(iter(self.Psi.values())))

    def _start_of_P(self) -> np.ndarray:
        """P(0); ones of the default where the block says something that does not fit, which is told elsewhere."""
        default = np.eye(self.count)
        try:
            return StateBlock.of(0, Symmetric(default)).initial(self.internal.get("P", 1.0), default)
        except ValueError:
            return default

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        q = self.count
        return {"Upsilon": np.zeros((form.plant.n, q)), "P": Symmetric(np.eye(q)), "rho": np.zeros(q)}

    def roles(self, form: CanonicalForm) -> dict[str, Role]:
        return {"Upsilon": "gain", "P": "gain", "rho": "filter"}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        Psi, Delta = self._regressors(plant, s, e), plant.inv_Delta(1 / k.theta)
        C_Upsilon = s.Upsilon[plant.form.heads, :]
        rho = -k.theta * s.P @ C_Upsilon.T @ e
        kappa = plant.inv_Delta(k.theta) @ (k.theta * k.G * plant.along_chains(e) - s.Upsilon @ rho)
        seen = C_Upsilon @ s.P
        forgetting = ca.fmax(0, ca.fmin(1, (1 - ca.trace(s.P) / k.p_max) / _CEASING))
        in_z = Psi if plant.form.identity else plant.form.J(plant.state(s.xhat), plant.p) @ Psi
        known = in_z if plant.canonical else Psi
        pulled = k.theta * (plant.links(s.xhat) @ s.Upsilon - ca.diag(k.G) @ _along(plant, C_Upsilon))
        return Flow(
            {
                "xhat": plant.copy(s.xhat) + known @ s.rho - plant.lift(s.xhat, kappa),
                "Upsilon": pulled + Delta @ in_z,
                "P": k.theta * (forgetting * s.P - seen.T @ seen),
                "rho": rho,
            },
            correction=plant.felt(s.xhat, kappa),
        )

    def _regressors(self, plant: PlantCopy, s: Symbols, e: ca.SX) -> ca.SX:
        """Psi at the estimate, shape (n, q)."""
        model, x = plant.form.plant, ca.vertsplit(plant.state(s.xhat))
        measured = ca.vertsplit(plant.output(s.xhat) - e)
        known = {"y": measured[0]} if len(measured) == 1 else {}
        known |= dict(zip(model.outputs, measured, strict=True)) | dict(zip(model.states, x, strict=True))
        rows = [self.Psi.get(name, ("0",) * self.count) for name in model.states]
        return ca.vertcat(*[ca.horzcat(*[of_copy(plant, text, known) for text in row]) for row in rows])

    def fastest_rate(self, form: CanonicalForm) -> float:
        return max(self._rate(form), self.theta)


def _names(form: CanonicalForm) -> tuple[str, ...]:
    """What expressions may hold."""
    plant = form.plant
    one = ("y",) if len(plant.outputs) == 1 else ()
    return ("t", *one, *plant.inputs, *plant.parameters, *plant.outputs, *plant.states)


def _along(plant: PlantCopy, rows: ca.SX) -> ca.SX:
    """One row an output, shape (q, m), repeated along the output's chain, shape (n, m)."""
    return ca.vertcat(*[rows[i, :] for i, length in enumerate(plant.chains) for _ in range(length)])
