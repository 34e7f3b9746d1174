"""Observers that estimate an unknown input at the end of every chain as well: the key ``extend``.

The last equation of a chain has an unknown term, z_n' = phi_n + d(t). With ``extend: m`` the chain that an observer is
for goes on with m integrators, z_(n+1) = sigma_1 for d, sigma_1' = sigma_2, ..., sigma_m' = 0: in the plant's own
coordinates x' = f(u, x) + J^-1 B sigma_1. Whatever the observer does along a chain of n, it does along this one of
n + m, and its gains are of that order. ``extended`` is ``shgo`` with this key. Triangular plants have one unknown input
in every equation of the last block, and go on with m blocks and F = 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import new_class
from typing import Any, ClassVar, Self, TypeVar, cast

import casadi as ca
import numpy as np
from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.errors import Problem
from hgorun.observers.base import (
    Arrival,
    ContinuousObserver,
    CorrectedObserver,
    DecidedObserver,
    Flow,
    PeriodLimit,
    Role,
)
from hgorun.observers.capabilities import GivenGain, LocallyLinear, SettlingGain
from hgorun.observers.common import CopyT, FormT
from hgorun.observers.recalling import RecallingObserver
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.forms import Form
from hgorun.symbolic.longer import has_unknown_inputs, longer, longer_copy, unknown_inputs
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.triangular import TriangularCopy


class Extendable(ContinuousObserver[FormT, CopyT]):
    """The key ``extend`` of an observer that takes a plant as chains, of whatever length, or block by block."""

    unknown: ClassVar[str] = "sigma"
    """Name of the states of unknown inputs."""

    extend: int | None = Field(
        default=None,
        ge=1,
        le=10,
        strict=True,
        description="m >= 1: also estimate an unknown input at the end of every chain, by m integrators sigma; "
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
    if observer.extend is None or isinstance(observer, Extension):
        return observer
    extended = extending(type(observer)).model_construct(observer.model_fields_set, **dict(observer))
    return cast(ExtendableT, extended)  # derived from both classes


@cache
def extending(family: type[Extendable[Any, Any]]) -> type[Extension]:
    """An observer's class with unknown inputs."""
    base: type[Extension] = Extension
    if issubclass(family, DecidedObserver):
        base = DecidedExtension
    elif issubclass(family, CorrectedObserver):
        base = CorrectedExtension
    elif issubclass(family, RecallingObserver):
        base = RecallingExtension
    own = {"__doc__": family.__doc__, "__module__": family.__module__, "family": family}
    return new_class(f"Extended{family.__name__}", (base, family), exec_body=lambda names: names.update(own))


class Extension(Extendable[Form, Any]):
    """An observer of longer chains or more blocks, whose last states are those of unknown inputs."""

    family: ClassVar[type[Extendable[Any, Any]]]
    """Whose equations these are, for the longer chains."""

    @property
    def added(self) -> int:
        """m."""
        assert self.extend is not None
        return self.extend

    def design(self, form: Form) -> Mapping[str, np.ndarray]:
        if not has_unknown_inputs(form):
            raise Problem(
                ("extend",),
                "outputs that measure the same have one unknown input between them, and this observer has one for "
                "each: leave out the outputs that are not needed",
            )
        return self.family.design(self, longer(form, self.added))

    def states(self, form: Form) -> Mapping[str, np.ndarray | Symmetric]:
        own = self.family.states(self, longer(form, self.added))
        return {**own, self.unknown: np.zeros((self.added, unknown_inputs(form)))}

    def roles(self, form: Form) -> Mapping[str, Role]:
        return {**self.family.roles(self, longer(form, self.added)), self.unknown: "filter"}

    def equations(self, plant: PlantCopy | TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        copy, whole = longer_copy(plant, self.added), self._whole(s)
        flow = self.family.equations(self, copy, whole, e, k)
        rate, correction = flow.derivatives["xhat"], flow.correction
        if correction is None:
            correction = ca.jtimes(copy.output(whole.xhat), whole.xhat, copy.copy(whole.xhat) - rate)
        return Flow({**flow.derivatives, **self._parts(rate, s)}, correction)

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return self.family.estimate(self, self._whole(s), k)[: s.xhat.numel()]

    def beyond(self, plant: PlantCopy | TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        """Of families that are :class:`LocallyLinear`."""
        assert isinstance(self, LocallyLinear)
        assert issubclass(self.family, LocallyLinear)
        return self.family.beyond(self, longer_copy(plant, self.added), self._whole(s), e, k)

    def characteristics(self, form: Form) -> list[np.ndarray]:
        """Of families that have a :class:`GivenGain`."""
        assert issubclass(self.family, GivenGain)
        assert isinstance(self, GivenGain)
        return self.family.characteristics(self, longer(form, self.added))

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """Of families that have a :class:`SettlingGain`."""
        assert isinstance(self, SettlingGain)
        assert issubclass(self.family, SettlingGain)
        return self.family.settled(self, longer(form, self.added))

    def fastest_rate(self, form: Form) -> float:
        return self.family.fastest_rate(self, longer(form, self.added))

    def error_rate(self, form: Form) -> float:
        return self.family.error_rate(self, longer(form, self.added))

    def remarks(self, form: Form) -> tuple[str, ...]:
        return self.family.remarks(self, longer(form, self.added))

    def _whole(self, s: Symbols) -> Symbols:
        """The states, with those of unknown inputs behind xhat: one unknown input after the other."""
        return Symbols(vars(s) | {"xhat": ca.vertcat(s.xhat, ca.vec(vars(s)[self.unknown]))})

    def _parts(self, value: ca.SX, s: Symbols) -> dict[str, ca.SX]:
        """Of xhat and of the unknown inputs, from both together."""
        n, shape = s.xhat.numel(), vars(s)[self.unknown].shape
        return {"xhat": value[:n], self.unknown: ca.reshape(value[n:], *shape)}

    def _split(self, new: Mapping[str, ca.SX], s: Symbols) -> dict[str, ca.SX]:
        """What states become, xhat in its parts."""
        return {**new, **self._parts(new["xhat"], s)} if "xhat" in new else dict(new)


class DecidedExtension(Extension, DecidedObserver[Form, Any]):
    """One that also decides."""

    def decide(self, plant: PlantCopy | TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        assert issubclass(self.family, DecidedObserver)
        return self._split(self.family.decide(self, longer_copy(plant, self.added), self._whole(s), e, k), s)

    def longest_step(self, form: Form) -> float:
        assert issubclass(self.family, DecidedObserver)
        return self.family.longest_step(self, longer(form, self.added))


class CorrectedExtension(Extension, CorrectedObserver[Form, Any]):
    """One that is corrected when samples arrive."""

    def correct(
        self, plant: PlantCopy | TriangularCopy, s: Symbols, arrival: Arrival, k: Symbols
    ) -> Mapping[str, ca.SX]:
        assert issubclass(self.family, CorrectedObserver)
        return self._split(self.family.correct(self, longer_copy(plant, self.added), self._whole(s), arrival, k), s)

    def equations(self, plant: PlantCopy | TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = self.family.equations(self, longer_copy(plant, self.added), self._whole(s), e, k)
        return Flow(self._split(flow.derivatives, s), flow.correction)

    def check_times(self, form: Form, times: Mapping[str, np.ndarray], origin: float) -> None:
        assert issubclass(self.family, CorrectedObserver)
        self.family.check_times(self, longer(form, self.added), times, origin)

    def whole_periods(self, form: Form) -> float | None:
        assert issubclass(self.family, CorrectedObserver)
        return self.family.whole_periods(self, longer(form, self.added))

    @property
    def asks_of_times(self) -> bool:
        assert issubclass(self.family, CorrectedObserver)
        return self.family.check_times is not CorrectedObserver.check_times

    def longest_period(self, form: Form) -> PeriodLimit | None:
        assert issubclass(self.family, CorrectedObserver)
        return self.family.longest_period(self, longer(form, self.added))


class RecallingExtension(Extension, RecallingObserver[Form, Any]):
    """One that looks back at signals of its own."""

    def longest_delay(self, form: Form) -> PeriodLimit:
        assert issubclass(self.family, RecallingObserver)
        return self.family.longest_delay(self, longer(form, self.added))

    def signals(self, plant: PlantCopy | TriangularCopy, s: Symbols, k: Symbols) -> ca.SX:
        assert issubclass(self.family, RecallingObserver)
        return self.family.signals(self, longer_copy(plant, self.added), self._whole(s), k)

    def compared(self, plant: PlantCopy | TriangularCopy, s: Symbols, k: Symbols) -> ca.SX:
        assert issubclass(self.family, RecallingObserver)
        return self.family.compared(self, longer_copy(plant, self.added), self._whole(s), k)
