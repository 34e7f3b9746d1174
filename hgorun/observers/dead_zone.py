"""The high-gain observer with a dead zone that follows the innovation."""

from __future__ import annotations

import casadi as ca
from pydantic import Field

from hgorun.config.types import NonNegative, Positive
from hgorun.errors import Problem
from hgorun.observers.base import observer
from hgorun.observers.innovation_zone import InnovationZone
from hgorun.observers.nested import clipped


@observer("dead_zone")
class DeadZoneObserver(InnovationZone):
    """High-gain observer with a dead zone as wide as the innovation has been lately, against persistent noise.

    For uniformly observable plants. With dz_w(e) the part of the innovation beyond +-w,

        xhat'  = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) G dz_w(e),    w = sqrt(sigma)
        sigma' = -lam sigma + rho e^2

    Persistent noise of root mean square s makes a zone of sqrt(rho/lam) s, in which the estimate is left alone; a
    larger error is corrected as by ``shgo``, less w. rho < lam is necessary: else every constant error e_1 has a zone
    sigma = rho e_1^2/lam that hides it. For phi = 0 the error decays exponentially if rho c_0 k^2 < lam mu^2, with P
    (A - K C) + (A - K C)^T P <= -2 mu P, k = |P^(1/2) K|, c_0 = |C P^(-1/2)|^2 at theta = 1, which is proved and
    conservative: rho/lam < 0.019 for n = 2 and 0.0021 for n = 3; in simulations it does so at rho/lam = 0.9. Samples
    and late outputs come through the common innovation, which sigma' reads between samples, too; there is no theorem
    for them. Choose it for persistent noise, and ``stubborn`` for outliers. It is best for slow plants: within the
    zone the copy of the plant is not corrected.
    """

    reference = "Alessandri, Zaccarian 2018; Astolfi, Alessandri, Zaccarian 2021, quoted from memory"

    lam: Positive | None = Field(
        default=None, description="rate at which the zone forgets, lam > 0, 1/time; theta/5 by default"
    )
    rho: NonNegative | None = Field(
        default=None,
        description="rate at which the squared innovation enters sigma, 0 <= rho < lam, 1/time; lam/5 by default",
    )

    def rates(self) -> tuple[float, float]:
        lam = self.theta / 5 if self.lam is None else self.lam
        rho = lam / 5 if self.rho is None else self.rho
        if rho >= lam:
            raise Problem(
                ("rho",),
                f"must be below lam = {lam:g}, found {rho:g}: a constant error e_1 would keep the zone sigma = "
                "rho e_1^2/lam >= e_1^2, which hides it",
            )
        return lam, rho

    @property
    def unhindered(self) -> float:
        """Beyond the zone of sigma = 0."""
        return 1e-100

    def passed(self, e: ca.SX, w: ca.SX) -> ca.SX:
        return e - clipped(e, w)
