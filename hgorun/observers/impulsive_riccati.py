"""The impulsive observer whose gain follows a Riccati equation."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.observers.base import Arrival, CorrectedObserver, Flow, PeriodLimit, observer
from hgorun.observers.capabilities import HighGain
from hgorun.observers.extension import Extendable
from hgorun.observers.gaussian import linear_update
from hgorun.observers.kalman import SensorNoise, by_output
from hgorun.observers.riccati import require_positive_definite
from hgorun.symbolic.forms import Form
from hgorun.symbolic.scaled import ScaledCopy, scaled_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("impulsive_riccati")
class ImpulsiveRiccatiObserver(HighGain, Extendable[Form, ScaledCopy], CorrectedObserver[Form, ScaledCopy]):
    """Continuous-discrete high-gain observer, for chains and triangular plants with outputs sampled at any times.

    Between samples a copy of the plant, and at samples, e = C xhat - y,

        xhat' = f(xhat, u)                    xhat+ = xhat - J^-1 K e,    K = P C^T (C P C^T + r)^-1
        P'    = theta P + F P + P F^T         P+    = P - K C P,          P(0) = I

    F = A in the coordinates z of the chain, and F(u, xhat) of a triangular plant that has none (observable under some
    inputs only), where J = I. P is the inverse of S' = -theta S - F^T S - S F, S+ = S + C^T C/r: least squares over all
    samples so far, the weight of each falling as exp(-theta) per time. That holds for any times of the samples, and
    for any subset of the outputs; ``impulsive`` has the same gain, D_T kappa(exp(-theta T)), without P, but for samples
    at uneven times no proof.

    For samples of a constant period K tends to that gain whatever r > 0, which only weighs P(0) and, with several
    outputs, these against each other. The error of a chain falls as exp(-theta t), up to powers of t, whatever the
    times. A larger theta is faster and amplifies noise; while F vanishes, or samples are missing, P grows as
    exp(theta t). Where the noise is known ``ekf`` has the smaller error; this needs one number.

    The jump is made in z with ``coordinates: canonical``. In the plant's coordinates, the default, J^-1 K e is its
    first order. P is in z, or in the coordinates where the plant is triangular. Late samples are replayed.

    The structure follows the publication, which was not at hand; equations and their properties are derived here.
    """

    reference = "Hammouri, Nadri, Mota 2006, in spirit"
    form = scaled_form

    theta: Positive = Field(description="forgetting theta > 0: the error of a chain falls as exp(-theta t)")
    r: SensorNoise = Field(default=1.0, description="weight r > 0 of all outputs, or output: number, in y^2")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def design(self, form: Form) -> dict[str, np.ndarray]:
        if "P" in self.internal:
            require_positive_definite("P", self.internal["P"], self.states(form)["P"])
        return {"theta": np.array(self.theta), "r": by_output(self.r, form, "r")}

    def states(self, form: Form) -> dict[str, Symmetric]:
        return {"P": Symmetric(np.eye(form.plant.n))}

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        F = plant.links(s.xhat)
        return Flow({"xhat": plant.copy(s.xhat), "P": k.theta * s.P + F @ s.P + s.P @ F.T})

    def correct(self, plant: ScaledCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        innovation = arrival.y - plant.output(s.xhat)
        shift, P = linear_update(s.P, innovation, ca.SX(plant.C), k.r, arrival.fresh, joseph=False)
        return {"xhat": s.xhat + plant.lift(s.xhat, shift), "P": P}

    def longest_period(self, form: Form) -> PeriodLimit:
        return PeriodLimit(None, "on a chain a sample multiplies the error by exp(-theta T): stable at every period")
