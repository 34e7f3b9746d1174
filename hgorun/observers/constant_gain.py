"""Gains that place the eigenvalues of an integrator chain, shared by the constant-gain observers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from hgorun.config.types import Number, Poles, Positive
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import FilterOrder, GivenGain, HighGain
from hgorun.observers.extension import Extendable
from hgorun.observers.uneven import refuse_of_uneven_chains
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.matrices import hurwitz_gain
from hgorun.symbolic.states import Symmetric


class PlacedGain(GivenGain):
    """Either ``poles`` or ``gains`` of an order that the family decides."""

    poles: Poles = Field(
        default=complex(-1), description="eigenvalues at theta = 1: a number (for all) or a list; real part < 0"
    )
    gains: tuple[Number, ...] | None = Field(
        default=None, description="the gain itself, instead of poles; with a filter (K_r; K_n)"
    )

    @model_validator(mode="after")
    def _one_of_poles_and_gains(self) -> PlacedGain:
        if self.gains is not None and "poles" in self.model_fields_set:
            raise ValueError("give either poles or gains, not both")
        return self

    @model_serializer(mode="wrap")
    def _one_of_them(self, values: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without poles where another key decides, so that what is written can be read."""
        return {key: value for key, value in values(self).items() if key != "poles" or self.poles_given}

    @property
    def poles_given(self) -> bool:
        """Whether the key ``poles`` decides, and no other one."""
        return self.gains is None

    @property
    def given_gain(self) -> str | None:
        return None if self.gains is None else "gains"

    def gain(self, order: int) -> np.ndarray:
        """The gain of a chain of this order, shape (order,)."""
        given = self.gains if self.gains is not None else self.poles
        if isinstance(given, tuple) and len(given) != order:
            key = "gains" if self.gains is not None else "poles"
            alternative = "" if self.gains is not None else ", or one number for all"
            raise Problem((key,), f"expected {order} numbers{alternative}; found {len(given)}")
        return np.asarray(self.gains) if self.gains is not None else hurwitz_gain(order, self.poles)

    def placed_poles(self, order: int) -> np.ndarray:
        """The poles that are asked for, shape (order,); all at -1 where the gain itself is given."""
        if self.gains is not None:
            return np.full(order, -1.0)
        return np.resize(np.atleast_1d(np.asarray(self.poles, dtype=complex)), order)

    def characteristics(self, form: Any) -> list[np.ndarray]:
        return [np.array([1.0, *gain]) for gain in self.gains_of_chains(form)]

    def gains_of_chains(self, form: CanonicalForm, filter_order: int = 0) -> list[np.ndarray]:
        """The gain of every chain, shape (filter_order + its length,)."""
        return self.gains_of_orders(form, [filter_order + length for length in form.chains])

    def gains_of_orders(self, form: CanonicalForm, orders: Sequence[int]) -> list[np.ndarray]:
        """The gain of every chain where its order is not its length."""
        if self.gains is not None:
            refuse_of_uneven_chains("gains", self.gains, form, orders, "write poles, one number for all")
        refuse_of_uneven_chains("poles", self.poles, form, orders, "write one number for all")
        return [self.gain(order) for order in orders]

    def largest_pole(self, form: CanonicalForm, filter_order: int = 0) -> float:
        """The largest modulus of the eigenvalues at theta = 1."""
        roots = [np.roots([1.0, *gain]) for gain in self.gains_of_chains(form, filter_order)]
        return max(float(np.max(np.abs(r))) for r in roots)

    def chain_gains(self, form: CanonicalForm, filter_order: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """(K_r; K_n) of every chain: K_r with one column a chain, shape (r, q), K_n stacked, shape (n,)."""
        gains = self.gains_of_chains(form, filter_order)
        K_r = np.column_stack([gain[:filter_order] for gain in gains])
        return K_r, np.concatenate([gain[filter_order:] for gain in gains])


class ConstantGain(HighGain, PlacedGain, ContinuousObserver):
    """theta, and a gain that places the eigenvalues at theta times the poles."""

    theta: Positive = Field(description="high gain theta > 0: the error's eigenvalues are theta times the poles")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def nominal_poles(self, order: int) -> np.ndarray:
        return self.placed_poles(order)

    def _rate(self, form: CanonicalForm, filter_order: int = 0) -> float:
        return self.theta * self.largest_pole(form, filter_order)


class FilteredGain(FilterOrder, Extendable, ConstantGain):
    """A gain (K_r; K_n) of order r + n: its first r numbers belong to a filter with state eta, one a chain."""

    r: int = Field(default=1, ge=0, le=20, strict=True, description="order of the filter, r >= 0; 0 is the SHGO")

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        K_r, K_n = self.chain_gains(form, self.r)
        return {"theta": np.array(self.theta), "K_r": K_r, "K_n": K_n}

    def characteristics(self, form: CanonicalForm) -> list[np.ndarray]:
        return [np.array([1.0, *gain]) for gain in self.gains_of_chains(form, self.r)]

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray | Symmetric]:
        return {"eta": np.zeros((self.r, len(form.chains)))} if self.r else {}

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form, self.r)
