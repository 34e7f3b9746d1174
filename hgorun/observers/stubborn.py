"""The stubborn high-gain observer, whose correction is cut off at what the innovation has been."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import NonNegative
from hgorun.errors import Problem
from hgorun.observers.base import observer
from hgorun.observers.innovation_zone import InnovationZone
from hgorun.observers.nested import clipped
from hgorun.observers.threshold import NoiseThreshold
from hgorun.symbolic.canonical import CanonicalForm

_WIDE = 9.0  # of the noise's variance: three standard deviations


@observer("stubborn")
class StubbornObserver(NoiseThreshold, InnovationZone):
    """High-gain observer that saturates the innovation at the size that it has had lately, against outliers.

    For uniformly observable plants. With sat_w(e) the innovation saturated at +-w,

        xhat'  = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) G sat_w(e),    w = sqrt(sigma)
        sigma' = -lam sigma + rho e^2

    A sampled outlier of size D that lasts one period T, sigma ~ 0 and theta T << 1 before it, has (2/3) sqrt(rho T)
    of the effect that it has on ``shgo``, however large D is: rho T << 1, or stubbornness does nothing. An error that
    grows by itself like exp(a t) gets the full gain back for certain if rho > lam + 2 a; with less, the correction
    acts by the factor sqrt(rho/(lam + 2 a)), and for phi = 0 the error was seen to vanish even with rho = lam/2 (n =
    2, 3, theta = 5). rho < lam is refused. sigma starts at 9 R, three standard deviations of the samples' noise,
    where that is known, and else at 0, from which the gain takes the time 1/rho to come; give ``internal: {sigma:
    ...}`` for a fast start. Samples and late outputs come through the common innovation, which sigma' reads between
    samples, too; there is no theorem for them. Choose it for outliers and short spikes, and ``dead_zone`` for noise
    that persists.
    """

    reference = "Alessandri, Zaccarian 2018; Astolfi, Alessandri, Zaccarian 2021, quoted from memory"

    lam: NonNegative | None = Field(
        default=None, description="rate at which the bound forgets, lam >= 0, 1/time; theta/5 by default"
    )
    rho: NonNegative | None = Field(
        default=None,
        description="rate at which the squared innovation enters sigma, rho >= lam, 1/time; 2 lam by default",
    )

    def rates(self) -> tuple[float, float]:
        lam = self.theta / 5 if self.lam is None else self.lam
        rho = 2 * lam if self.rho is None else self.rho
        if rho < lam:
            raise Problem(
                ("rho",),
                f"must not be below lam = {lam:g}, found {rho:g}: of a constant error a part would never be seen",
            )
        return lam, rho

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray]:
        return {"sigma": _WIDE * self.variances(len(form.chains))}

    def passed(self, e: ca.SX, w: ca.SX) -> ca.SX:
        return clipped(e, w)
