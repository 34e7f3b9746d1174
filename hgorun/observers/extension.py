"""Observers that estimate an unknown input at the end of every chain as well: the key ``extend``.

The last equation of a chain has an unknown term, z_n' = phi_n + d(t). With ``extend: m`` the chain that an observer is
for goes on with m integrators, z_(n+1) = sigma_1 for d, sigma_1' = sigma_2, ..., sigma_m' = 0: in the plant's own
coordinates x' = f(u, x) + J^-1 B sigma_1. Whatever the observer does along a chain of n, it does along this one of
n + m, and its gains are of that order. ``extended`` is ``shgo`` with this key. Triangular plants have one unknown input
in every equation of the last block, and go on with m blocks and F = 1.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self, TypeVar

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.observers.base import ContinuousObserver, CopyT, FormT


class Extendable(ContinuousObserver[FormT, CopyT]):
    """The key ``extend`` of an observer that takes a plant as chains, of whatever length, or block by block."""

    unknown: ClassVar[str] = "sigma"
    """Name of the states of unknown inputs."""

    extend: int | None = Field(
        default=None,
        ge=1,
        le=10,
        strict=True,
        description="m >= 1: an unknown input at the end of every chain is estimated, too, by m integrators sigma; "
        "poles and gains are those of chains that are longer by m",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _extended(cls, data: Any, check: ModelWrapValidatorHandler[Self]) -> Self:
        """A block with ``extend`` is an observer with more states."""
        return with_unknown_inputs(check(data))


ExtendableT = TypeVar("ExtendableT", bound="Extendable[Any, Any]")


def with_unknown_inputs(observer: ExtendableT) -> ExtendableT:
    """The observer that its key ``extend`` makes of it; itself where it has none."""
    if observer.extend is None:
        return observer
    from hgorun.observers.longer_chains import extended  # which is derived from what is here

    return extended(observer)
