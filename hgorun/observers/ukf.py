"""The unscented Kalman filter of a sampled measurement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import casadi as ca
import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from hgorun.config.types import NUMBER_SCHEMA, NonNegative, Number, number
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, CorrectedObserver, Flow, observer
from hgorun.observers.capabilities import Averaged
from hgorun.observers.gaussian import conditioned
from hgorun.observers.kalman import ChainNoise, KalmanFilter
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.symbols import Symbols

Share = Annotated[float, BeforeValidator(number), Field(gt=0, le=1), WithJsonSchema(NUMBER_SCHEMA)]


@observer("ukf")
class UnscentedKalmanFilter(Averaged, KalmanFilter, CorrectedObserver[Form, ModelCopy]):
    """Continuous-discrete unscented Kalman filter, for any smooth plant with sampled outputs.

    For the plant of ``ekf``, x' = f(x, u) + w and y_k = h(x(t_k), u) + v_k with noise of the density Q and of the
    variance R. No Jacobian is taken: f and h are evaluated at 2n + 1 points around the estimate,

        X_0 = xhat,  X_i = xhat +- sqrt(n + lam) L_i,    P = L L^T,    lam = alpha^2 (n + kappa) - n

    L_i the columns of Cholesky's factor. Their weights are W^m_0 = lam/(n + lam) for means, W^c_0 = W^m_0 + 1 -
    alpha^2 + beta for covariances, and 1/(2 (n + lam)) for all others. Between samples

        xhat' = sum W^m f(X)
        P'    = M + M^T + Q,    M = sum W^c (X - xhat) (f(X) - xhat')^T,    P(0) = I

    and when samples arrive, with the points drawn again, yhat = sum W^m h(X),

        S     = sum W^c (h(X) - yhat) (h(X) - yhat)^T + R,    P_xy = sum W^c (X - xhat) (h(X) - yhat)^T
        K     = P_xy S^-1,    xhat+ = xhat + K (y - yhat),    P+ = P - K S K^T

    A sample is compared with yhat, and a gate judges it by S. Rows and columns of outputs without a new sample are
    left out. Points are drawn at every stage of a step. Since they come in pairs, sum W^m f(X) = f(xhat) + sum (f(X) -
    f(xhat))/(2 (n + lam)), which is how it is evaluated: a small alpha, whose weights are large and of both signs,
    loses no digits that way, and M takes differences of pairs alone.

    On a linear plant this is ``ekf``, whatever alpha, beta and kappa. It takes into account curvature on the scale of
    P^(1/2), such as the mean of x^2, and costs 2n + 1 evaluations of f and a Cholesky factor per stage: take it if
    ``ekf`` is biased or its P is not consistent with its errors. alpha = 1, beta = 0 and kappa = 3 - n are right up
    to the fourth moment of one direction. For n > 3 that makes W_0 negative and P may lose its sign, when the
    estimate is no longer a number: kappa = 0 does not. So may P(0) much larger than what P settles to, with long
    steps: give shorter ones.

    Q or q or theta, R, P(0), multiplicative noise and late samples are as for ``ekf``; chain noise is that at the
    estimate. The moment equations are quoted from memory of the publication; the identities above are derived.
    """

    reference = "Sarkka 2007 (moment form of the continuous-discrete filter); Julier, Uhlmann 1997"
    of_samples = True

    alpha: Share = Field(default=1.0, description="how far the points reach, in (0, 1]")
    beta: NonNegative = Field(default=0.0, description="extra weight of the estimate itself in covariances, >= 0")
    kappa: Number | None = Field(
        default=None, description="weight of the estimate among the points, > -n; 3 - n by default"
    )

    @classmethod
    def on_chains(cls) -> type[KalmanFilter]:
        return ChainUnscentedKalmanFilter

    def design(self, form: Form) -> Mapping[str, np.ndarray]:
        n = form.plant.n
        kappa = 3.0 - n if self.kappa is None else self.kappa
        if not n + kappa > 0:
            raise Problem(("kappa",), f"expected more than -n = {-n}; found {kappa:g}")
        reach = self.alpha**2 * (n + kappa)  # n + lam
        return {
            **super().design(form),
            "reach": np.sqrt(reach),
            "weight": np.array(1 / (2 * reach)),
            "middle": np.array(1 - n / reach + 1 - self.alpha**2 + self.beta),
        }

    def equations(self, plant: ModelCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        f, pairs = plant.copy(s.xhat), _pairs(s.xhat, s.P, k.reach)
        both = [(shift, plant.copy(s.xhat + shift), plant.copy(s.xhat - shift)) for shift in pairs]
        mean = f + k.weight * sum((up + down - 2 * f for _, up, down in both), ca.SX(0))
        M = k.weight * sum((shift @ (up - down).T for shift, up, down in both), ca.SX(0))
        return Flow({"xhat": mean, "P": M + M.T + self.density(plant, s.xhat, k)})

    def correct(self, plant: ModelCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        yhat, S, P_xy = self._moments(plant, s, k, noise=True)
        joint = ca.blockcat([[s.P, P_xy], [P_xy.T, S]])
        xhat, P = conditioned(ca.vertcat(s.xhat, yhat), joint, arrival.y, arrival.fresh)
        return {"xhat": xhat, "P": P}

    def expected(self, plant: ModelCopy, s: Symbols, k: Symbols) -> tuple[ca.SX, ca.SX]:
        if ca.is_linear(plant.output(s.xhat), s.xhat):  # of which the points make the same
            return super().expected(plant, s, k)
        yhat, S, _ = self._moments(plant, s, k, noise=False)
        return yhat, ca.diag(S)

    def _moments(self, plant: ModelCopy, s: Symbols, k: Symbols, *, noise: bool) -> tuple[ca.SX, ca.SX, ca.SX]:
        """yhat, S, with R or without it, and P_xy."""
        h, pairs = plant.output(s.xhat), _pairs(s.xhat, s.P, k.reach)
        both = [(shift, plant.output(s.xhat + shift), plant.output(s.xhat - shift)) for shift in pairs]
        yhat = h + k.weight * sum((up + down - 2 * h for _, up, down in both), ca.SX(0))
        P_xy = k.weight * sum((shift @ (up - down).T for shift, up, down in both), ca.SX(0))
        S = k.middle * (h - yhat) @ (h - yhat).T
        if noise:
            S += ca.diag(self.variance(yhat, k))
        for _, *ends in both:
            for end in ends:
                S += k.weight * (end - yhat) @ (end - yhat).T
        return yhat, S, P_xy


class ChainUnscentedKalmanFilter(ChainNoise, UnscentedKalmanFilter):
    """The filter with its process noise at the ends of chains; see :class:`UnscentedKalmanFilter`."""


def _pairs(xhat: ca.SX, P: ca.SX, reach: ca.SX) -> list[ca.SX]:
    """reach L_i: how far the points of each pair lie from the estimate."""
    L = ca.chol(P).T
    return [reach * L[:, i] for i in range(xhat.numel())]
