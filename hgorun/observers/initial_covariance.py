"""Where the matrix P of a filter begins, and under which names that is sought."""

from __future__ import annotations

from hgorun.config.types import Block


class BeginsWithCovariance(Block):
    """The state ``P`` begins at a matrix that ``internal`` sets, which is sought under other names."""

    @classmethod
    def _inside(cls, key: object, value: object) -> str:
        if key in ("P", "P0", "P_0", "P_init", "covariance"):
            return " What P begins at is `internal: {P: ...}`."
        return super()._inside(key, value)
