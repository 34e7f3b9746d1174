"""The high-gain extended Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, CorrectedObserver, Flow, observer
from hgorun.observers.capabilities import HighGain, NoiseInformed, SettlingGain
from hgorun.observers.extension import with_unknown_inputs
from hgorun.observers.gaussian import linear_update
from hgorun.observers.intervals import mean_intervals
from hgorun.observers.kalman import by_output
from hgorun.observers.scaled_filter import ScaledFilter
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form
from hgorun.symbolic.scaled import ScaledCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


class HighGainFilter(HighGain, SettlingGain, ScaledFilter):
    """The keys of a high-gain Kalman filter."""

    reference = "Deza, Busvelle, Gauthier, Rakotopara 1992; Gauthier, Kupka 2001, chapter 6"

    theta: Positive = Field(description="high gain theta > 0; the theorem asks for theta >= 1, large enough")
    update: Literal["flow", "jump"] = Field(
        default="flow",
        description="flow: as for continuous outputs, samples enter the innovation; jump: corrected whenever samples "
        "arrive",
    )
    interval: Positive | None = Field(
        default=None,
        description="update: jump, mean time T between two samples; from the measurement by default",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _by_update(cls, data: Any, check: ModelWrapValidatorHandler[HighGainFilter]) -> HighGainFilter:
        """A block with ``update: jump`` is an observer of another kind."""
        found = check(data)
        if found.update == "flow" and found.interval is not None:
            raise Problem(("interval",), "interval is a key of update: jump")
        if found.update == "flow" or isinstance(found, CorrectedObserver):
            return found
        return with_unknown_inputs(SampledHighGainFilter.model_construct(found.model_fields_set, **dict(found)))

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def design(self, form: Form) -> dict[str, np.ndarray]:
        return {"theta": np.array(self.theta), **super().design(form)}

    def states(self, form: Form) -> dict[str, Symmetric]:
        return {"P": Symmetric(np.eye(form.plant.n))}

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """P = Delta^-1 P_1 Delta^-1, P_1 of theta = 1."""
        assert isinstance(form, CanonicalForm)
        scale = np.concatenate([self.theta ** np.arange(length) for length in form.chains])
        return {"P": scale[:, None] * self.at_rest(form.chains, by_output(self.R, form))[0] * scale}

    def fastest_rate(self, form: Form) -> float:
        return self.rate(form, self.theta)


@observer("hg_ekf")
class HighGainKalmanFilter(HighGainFilter):
    """High-gain extended Kalman filter, for plants that are chains or triangular block by block.

    A Kalman filter whose process noise is scaled with theta in the coordinates z = Phi(x) of the chains, so that its
    error decays at a chosen rate from any start if theta is large enough, as with a high-gain observer, while its
    gain stays that of a filter. With F = df/dx, the whole Jacobian at the estimate, H = dh/dx and the innovation e,

        xhat' = f(xhat, u) - P H^T R_theta^-1 e
        P'    = F P + P F^T + Q_theta - P H^T R_theta^-1 H P,    P(0) = I
        Q_theta = theta Delta^-1(theta) Q Delta^-1(theta),    R_theta = R/theta

    In the coordinates of the plant, the default, Q_theta stands between J^-1 and J^-T, J = dPhi/dx at the estimate;
    with ``coordinates: canonical`` the filter runs on z itself. These are two observers, since J changes along the
    correction too. A plant without chains that is triangular (observable under some inputs only) is taken block by
    block from its measured states, with Delta of the blocks, in the coordinates where it is triangular.

    With P = Delta^-1 Pb Delta^-1, Pb' = theta (A Pb + Pb A^T + Q - Pb C^T R^-1 C Pb) plus terms of the nonlinearity,
    and the gain is theta Delta^-1 Pb C^T R^-1: for phi = 0 and t -> infinity this is ``shgo`` with G = Pb C^T R^-1,
    (1.7321, 1) for n = 2 and (2.4142, 2.4142, 1) for n = 3 with Q = I, R = 1. theta = 1 is ``kalman_bucy``. Against
    ``shgo_riccati``: that takes the superdiagonal of F only, and forgets (theta P) in place of Q.

    Q [z_i z_j/time] and R [y^2 time] at theta = 1 are weights, not the noise; their ratio shapes the poles. P(0) has
    units, and a large one asks for short steps. Choose it over ``shgo`` where poles that follow the plant's slopes
    give less noise, and over ``kalman_bucy`` or ``ekf`` where a wrong start makes these diverge.

    Samples and late outputs enter by the common innovation. ``update: jump`` takes them in when they arrive, as
    ``ekf`` does, P growing with Q_theta in between: a sample has the variance R/(theta T), T the mean time between
    samples, and late samples are replayed. For short T both are the same; the jump is stable for any T.

    The scaling is quoted from memory of the publications, which differ in a factor theta; the identities here are
    derived and tested.
    """

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow(self.flow(plant, s, e, k, k.theta))


class SampledHighGainFilter(NoiseInformed, HighGainFilter, CorrectedObserver[Form, ScaledCopy]):
    """The filter that is corrected whenever samples arrive; see :class:`HighGainKalmanFilter`."""

    def design(self, form: Form) -> dict[str, np.ndarray]:
        numbers = super().design(form)
        T = mean_intervals(self.interval, self._sensors, form, "interval")
        return numbers | {"R": numbers["R"] / T}

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "P": self.spread(plant, s, k, k.theta)})

    def correct(self, plant: ScaledCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y = plant.output(s.xhat)
        shift, P = linear_update(s.P, arrival.y - y, ca.jacobian(y, s.xhat), k.R / k.theta, arrival.fresh)
        return {"xhat": s.xhat + shift, "P": P}
