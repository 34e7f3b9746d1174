"""The observer of the closed-loop literature: a chain of two without a model, registered while a test needs it."""

from collections.abc import Iterator
from contextlib import contextmanager

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.observers.base import OBSERVERS, ContinuousObserver, Flow
from hgorun.observers.capabilities import Differentiator
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.symbols import Symbols


class PlainDifferentiator(Differentiator, ContinuousObserver[DerivativeForm, DerivativeCopy]):
    """xhat1' = xhat2 - 2 theta e, xhat2' = -theta^2 e: neither phi nor u."""

    reference = "Atassi, Khalil 1999"
    form = staticmethod(derivative_form)

    theta: float = Field(description="gain")

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        return {"theta": np.array(self.theta)}

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        rate = ca.vertcat(s.xhat[1] - 2 * k.theta * e, -(k.theta**2) * e)
        return Flow({"xhat": rate}, correction=2 * k.theta * e)

    def fastest_rate(self, form: DerivativeForm) -> float:
        return self.theta


@contextmanager
def registered() -> Iterator[None]:
    """As the type ``plain_differentiator``."""
    OBSERVERS.register("plain_differentiator")(PlainDifferentiator)
    try:
        yield
    finally:
        OBSERVERS.forget("plain_differentiator")
