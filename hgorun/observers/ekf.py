"""The extended Kalman filter of a sampled measurement."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from hgorun.observers.base import Arrival, CorrectedObserver, Flow, observer
from hgorun.observers.gaussian import linear_update
from hgorun.observers.kalman import ChainNoise, KalmanFilter
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.symbols import Symbols


@observer("ekf")
class ExtendedKalmanFilter(KalmanFilter, CorrectedObserver[Form, ModelCopy]):
    """Continuous-discrete extended Kalman filter, for any smooth plant with sampled outputs.

    The plant is x' = f(x, u) + w with white noise w of the density Q, and y_k = h(x(t_k), u) + v_k with
    independent noise of the variance R. With F = df/dx at the estimate, between samples

        xhat' = f(xhat, u)
        P'    = F P + P F^T + Q,    P(0) = I

    and when samples arrive, with H = dh/dx at the estimate before,

        K     = P H^T (H P H^T + R)^-1
        xhat+ = xhat + K (y - h(xhat))
        P+    = (I - K H) P (I - K H)^T + K R K^T

    Outputs may be sampled at different times, and samples may be missing: of y, h, H and R the rows of those outputs
    are taken that have a new sample. They enter together, at one estimate and one P; since their noise is
    independent, they are processed one after the other, with the remaining innovation of the linearised output,
    without an inverse.

    Q is given in the plant's coordinates and units, [x_i x_j/time]. Or, for plants that are chains of integrators or
    become chains through their observability map: ``q``, the density at the end of each chain, or ``theta``, with q =
    R T theta^(2n) and T the mean time between samples: for phi = 0 and short periods that is the high-gain observer
    ``shgo`` with this theta and Butterworth poles. Without process noise the gain would go to zero.

    R, in [y^2], follows from the noise of the measurement: the variance of random noise, half the squared amplitude
    of sinusoids; noise in proportion to the output has the variance R h(xhat)^2. P(0) has units: give
    ``internal: {P: ...}``. For continuous outputs take ``kalman_bucy``.
    """

    reference = "Jazwinski 1970, 8.3; Gelb 1974, 6.1"
    of_samples = True

    @classmethod
    def on_chains(cls) -> type[KalmanFilter]:
        return ChainExtendedKalmanFilter

    def equations(self, plant: ModelCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "P": self.spread(plant, s.xhat, s.P, k)})

    def correct(self, plant: ModelCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y = plant.output(s.xhat)
        H, R = ca.jacobian(y, s.xhat), self.variance(y, k)
        shift, P = linear_update(s.P, arrival.y - y, H, R, arrival.fresh)
        return {"xhat": s.xhat + shift, "P": P}


class ChainExtendedKalmanFilter(ChainNoise, ExtendedKalmanFilter):
    """The filter with its process noise at the ends of chains; see :class:`ExtendedKalmanFilter`."""
