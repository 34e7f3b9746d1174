"""The high-gain extended Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import casadi as ca
import numpy as np
from pydantic import Discriminator, Field, ModelWrapValidatorHandler, PrivateAttr, Tag, model_validator

from hgorun.config.types import Number, Positive
from hgorun.observers.base import Arrival, ContinuousObserver, CorrectedObserver, Flow, observer
from hgorun.observers.capabilities import HighGain, NoiseInformed, SettlingGain
from hgorun.observers.gaussian import linear_update, spread_along
from hgorun.observers.kalman import SensorNoise, by_output, mean_intervals, require_covariance
from hgorun.observers.riccati import require_positive_definite
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form
from hgorun.symbolic.scaled import ScaledCopy, scaled_form
from hgorun.symbolic.sensors import Sensor
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols

Weight = Annotated[
    Annotated[Positive, Tag("a number")] | Annotated[tuple[tuple[Number, ...], ...], Tag("rows")],
    Discriminator(lambda value: "rows" if isinstance(value, (list, tuple)) else "a number"),
]


class HighGainFilter(HighGain, SettlingGain, ContinuousObserver[Form, ScaledCopy]):
    """The keys of a high-gain Kalman filter, and P between samples."""

    form = scaled_form
    reference = "Deza, Busvelle, Gauthier, Rakotopara 1992; Gauthier, Kupka 2001, chapter 6"

    theta: Positive = Field(description="high gain theta > 0; the theorem asks for theta >= 1, large enough")
    Q: Weight = Field(default=1.0, description="of z at theta = 1: a multiple of the identity, or the rows of a matrix")
    R: SensorNoise = Field(default=1.0, description="at theta = 1, of all outputs, or output: number")
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
            raise ValueError("interval is a key of update: jump")
        if found.update == "flow" or isinstance(found, CorrectedObserver):
            return found
        return SampledHighGainFilter.model_construct(found.model_fields_set, **dict(found))

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def design(self, form: Form) -> dict[str, np.ndarray]:
        if "P" in self.internal:
            require_positive_definite("P", self.internal["P"], self.states(form)["P"])
        return {"theta": np.array(self.theta), "Q": self._weight(form.plant.n), "R": by_output(self.R, form)}

    def _weight(self, n: int) -> np.ndarray:
        """Q, shape (n, n)."""
        if not isinstance(self.Q, tuple):
            return self.Q * np.eye(n)
        return require_covariance(self.Q, n, "a multiple of the identity")

    def states(self, form: Form) -> dict[str, Symmetric]:
        return {"P": Symmetric(np.eye(form.plant.n))}

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """P = Delta^-1 P_1 Delta^-1, P_1 of theta = 1."""
        assert isinstance(form, CanonicalForm)
        scale = np.concatenate([self.theta ** np.arange(length) for length in form.chains])
        return {"P": scale[:, None] * self._at_rest(form.chains, by_output(self.R, form))[0] * scale}

    def _at_rest(self, chains: tuple[int, ...], R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """On chains of integrators with theta = 1 the P at which Riccati's equation rests, and the error's matrix."""
        from scipy.linalg import block_diag, solve_continuous_are

        shift = block_diag(*[np.eye(length, k=1) for length in chains])
        C = np.eye(len(shift))[np.cumsum([0, *chains[:-1]])]
        P = solve_continuous_are(shift.T, C.T, self._weight(len(shift)), np.diag(R))
        return P, shift - P @ C.T @ np.diag(1 / R) @ C

    def spread(self, plant: ScaledCopy, s: Symbols, k: Symbols) -> ca.SX:
        """F P + P F^T + Q_theta, F the whole Jacobian of the copy."""
        scale = k.theta * plant.inv_Delta(k.theta) @ k.Q @ plant.inv_Delta(k.theta)
        back = ca.horzcat(*[plant.lift(s.xhat, ca.SX(unit)) for unit in ca.horzsplit(ca.DM.eye(scale.size1()))])
        return spread_along(ca.jacobian(plant.copy(s.xhat), s.xhat), s.P, back @ scale @ back.T)

    def fastest_rate(self, form: Form) -> float:
        """That of P' = -P^2 theta/R at the start, or of chains at rest, whichever is faster."""
        chains = form.chains if isinstance(form, CanonicalForm) else (form.plant.n,)
        R = np.resize(by_output(self.R, form), len(chains))
        _, closed = self._at_rest(chains, R)
        default = self.states(form)["P"]
        start = StateBlock.of(0, default).initial(self.internal.get("P", 1.0), default.values)
        rest = float(np.max(np.abs(np.linalg.eigvals(closed))))
        return self.theta * max(rest, 2 * float(np.max(np.linalg.eigvalsh(start))) / float(np.min(R)))


@observer("hg_ekf")
class HighGainKalmanFilter(HighGainFilter):
    """High-gain extended Kalman filter, for plants that are chains or triangular block by block.

    A Kalman filter whose process noise is scaled with theta in the coordinates z = Phi(x) of the chains, so that its
    error decays as fast as one likes from any start once theta is large, as that of a high-gain observer does, while
    its gain stays that of a filter. With F = df/dx, the whole Jacobian at the estimate, H = dh/dx and the innovation e,

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

    Samples and late outputs enter by the common innovation. ``update: jump`` takes them in when they arrive, as ``ekf``
    does, P growing with Q_theta in between: a sample has the variance R/(theta T), T the mean time between samples, and
    late samples are replayed. For short T both are the same; the jump bears any T.

    The scaling is quoted from memory of the publications, which differ in a factor theta; the identities here are
    derived and tested.
    """

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        H = ca.jacobian(plant.output(s.xhat), s.xhat)
        K = s.P @ H.T @ ca.diag(k.theta / k.R)
        return Flow({"xhat": plant.copy(s.xhat) - K @ e, "P": self.spread(plant, s, k) - K @ (H @ s.P)})


class SampledHighGainFilter(NoiseInformed, HighGainFilter, CorrectedObserver[Form, ScaledCopy]):
    """The filter that is corrected whenever samples arrive; see :class:`HighGainKalmanFilter`."""

    _sensors: tuple[Sensor, ...] = PrivateAttr(default=())

    def informed(self, sensors: Sequence[Sensor]) -> Self:
        copied = self.model_copy()
        copied._sensors = tuple(sensors)
        return copied

    def design(self, form: Form) -> dict[str, np.ndarray]:
        numbers = super().design(form)
        T = mean_intervals(self.interval, self._sensors, form, "interval")
        return numbers | {"R": numbers["R"] / T}

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "P": self.spread(plant, s, k)})

    def correct(self, plant: ScaledCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y = plant.output(s.xhat)
        shift, P = linear_update(s.P, arrival.y - y, ca.jacobian(y, s.xhat), k.R / k.theta, arrival.fresh)
        return {"xhat": s.xhat + shift, "P": P}
