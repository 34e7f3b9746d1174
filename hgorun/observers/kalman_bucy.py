"""The extended Kalman filter of a continuous measurement."""

from __future__ import annotations

import casadi as ca

from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import FollowingGain, Speed
from hgorun.observers.kalman import ChainNoise, KalmanFilter
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.symbols import Symbols


@observer("kalman_bucy")
class KalmanBucyFilter(FollowingGain, KalmanFilter):
    """Extended Kalman-Bucy filter, for any smooth plant with any outputs.

    The plant is x' = f(x, u) + w, y = h(x, u) + v with white noise of the densities Q and R_c. With
    F = df/dx and H = dh/dx at the estimate, and e the innovation,

        xhat' = f(xhat, u) - P H^T R_c^-1 e
        P'    = F P + P F^T + Q - P H^T R_c^-1 H P,    P(0) = I

    Q is given in the plant's coordinates and units, [x_i x_j/time]. Or, for plants that are chains of integrators or
    become chains through their observability map: ``q``, the density at the end of each chain, or ``theta``, with q =
    R_c theta^(2n). For phi = 0 and t -> infinity that is the high-gain observer ``shgo`` with this theta and
    Butterworth poles: gains (1.4142, 1), (2, 2, 1), (2.6131, 3.4142, 2.6131, 1).

    R_c, in [y^2 time], follows from noise that is drawn anew every dt: variance times dt. P(0) has units, so give
    ``internal: {P: ...}``: with a large one the first measurements count most, and short steps are needed for them.

    Samples and late outputs come through the common innovation, for which the gain is not optimal: a large P(0), or a
    delay that is long compared with 1/theta, makes the error grow. Take ``ekf`` for samples, or a high-gain observer,
    whose error bounds hold with them. Where the plant is linear and the noise is white, no observer has a smaller
    error. Otherwise it may diverge from a poor initial estimate, from which high-gain observers converge.
    """

    reference = "Kalman, Bucy 1961; Gelb 1974, 6.1"
    of_samples = False

    @classmethod
    def on_chains(cls) -> type[KalmanFilter]:
        return ChainKalmanBucyFilter

    def equations(self, plant: ModelCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        H = ca.jacobian(plant.output(s.xhat), s.xhat)
        K = s.P @ H.T @ ca.diag(1 / k.R)
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - K @ e,
                "P": self.spread(plant, s.xhat, s.P, k) - K @ H @ s.P,
            }
        )

    def fastest_rate(self, form: Form) -> float:
        """That of P at the start, where outputs are states: P' = -P^2/R_c."""
        plant = form.plant
        P, R = self.start_of(form)["P"], self.design(form)["R"]
        pairs = [(plant.outputs.index(y), plant.states.index(x)) for y, x in plant.measures.items()]
        return float(max((2 * P[j, j] / R[i] for i, j in pairs), default=0.0))


class ChainKalmanBucyFilter(Speed, ChainNoise, KalmanBucyFilter):
    """The filter with its process noise at the ends of chains; see :class:`KalmanBucyFilter`."""

    @property
    def speed_key(self) -> str | None:
        return None if self.theta is None else "theta"
