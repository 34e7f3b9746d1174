"""The output injection of the observers for lower triangular plants."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from hgorun.config.types import Number, Poles
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import GivenGain
from hgorun.symbolic.lower_triangular import LowerTriangularCopy, LowerTriangularForm, lower_triangular_form
from hgorun.symbolic.matrices import hurwitz_gain


class Blend(NamedTuple):
    """w = exp(-mu (y - yhat)^2) for the observer, 1 - w for a reconstruction that pulls with Gamma, of phi/2."""

    mu: float
    phi: float


class OutputInjection(GivenGain, ContinuousObserver[LowerTriangularForm, LowerTriangularCopy]):
    """The vector l of a correction Theta l (y - yhat): given itself, or through poles."""

    form = staticmethod(lower_triangular_form)

    l: tuple[Number, ...] | None = Field(  # noqa: E741  # the papers' letter
        default=None, description="n gains, Theta l (y - yhat); instead of poles"
    )
    poles: Poles = Field(
        default=complex(-1),
        description="eigenvalues of A - l c at theta = 1: a number or n; real part < 0; for slopes of 1",
    )

    @model_validator(mode="after")
    def _one_of_poles_and_l(self) -> OutputInjection:
        if self.l is not None and "poles" in self.model_fields_set:
            raise ValueError("give either poles or l, not both")
        return self

    @model_serializer(mode="wrap")
    def _one_of_them(self, values: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without poles where l is given, so that what is written can be read."""
        return {key: value for key, value in values(self).items() if key != "poles" or self.l is None}

    def injection(self, form: LowerTriangularForm) -> np.ndarray:
        """l, shape (n,)."""
        given = self.l if self.l is not None else self.poles
        if isinstance(given, tuple) and len(given) != form.n:
            key = "poles" if self.l is None else "l"
            raise Problem((key,), f"expected {form.n} numbers, one per state; found {len(given)}")
        return np.asarray(self.l) if self.l is not None else hurwitz_gain(form.n, self.poles)

    @property
    def blend(self) -> Blend | None:
        """How a direct reconstruction of the state is blended in; None: not at all."""
        return None

    @property
    def given_gain(self) -> str | None:
        return None if self.l is None else "l"

    def characteristics(self, form: LowerTriangularForm) -> list[np.ndarray]:
        rows = slopes_of_l(form)
        rows = rows if len(rows) else np.ones((1, form.n))
        return [np.array([1.0, *(self.injection(form) * row)]) for row in rows]

    def _rate(self, form: LowerTriangularForm) -> float:
        """The fastest eigenvalue of A - l c at theta = 1, for the plant's slopes near the start."""
        return max(float(np.max(np.abs(np.roots(p)), initial=0.0)) for p in self.characteristics(form))


def slopes_of_l(form: LowerTriangularForm) -> np.ndarray:
    """What each entry of l counts with in the error's characteristic polynomial, near the start.

    With y = c x_1 and x_i' = s_i x_(i+1) + ... the eigenvalues at theta = 1 are the roots of
    s^n + l_1 c s^(n-1) + l_2 c s_1 s^(n-2) + ...

    Returns
    -------
    ndarray, shape (points, n)
        c, c s_1, c s_1 s_2, ...; points where one of them vanishes or is not a number are left out.
    """
    factors = np.cumprod(form.links, axis=1)
    return np.asarray(factors[np.all(np.isfinite(factors) & (factors != 0), axis=1)])
