"""The matrix P of a filter: where it begins, under which names that is sought, and what it says of samples."""

from __future__ import annotations

from typing import Any

import casadi as ca

from hgorun.config.types import Block
from hgorun.symbolic.symbols import Symbols


class BeginsWithCovariance(Block):
    """The state ``P`` begins at a matrix that ``internal`` sets, which is sought under other names."""

    @classmethod
    def _inside(cls, key: object, value: object) -> str:
        if key in ("P", "P0", "P_0", "P_init", "covariance"):
            return " What P begins at is `internal: {P: ...}`."
        return super()._inside(key, value)


class KnownCovariance(BeginsWithCovariance):
    """The state ``P`` is the covariance of the error of xhat, in the coordinates where the observer computes."""

    def expected(self, plant: Any, s: Symbols, k: Symbols) -> tuple[ca.SX, ca.SX]:
        """What samples are expected to be, shape (q,), and the variances of that, without the noise of sensors."""
        y = plant.output(s.xhat)
        H = ca.jacobian(y, s.xhat)
        return y, ca.diag(H @ s.P @ H.T)
