"""The derivative by a least-squares polynomial: what observers are compared with."""

from __future__ import annotations

from collections.abc import Mapping
from math import factorial

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.errors import Problem
from hgorun.observers.base import Arrival, observer
from hgorun.observers.capabilities import NO_MODEL, Differentiator
from hgorun.observers.last_samples import LastSamples
from hgorun.observers.least_squares import TINY, projections
from hgorun.observers.stepped import SteppedObserver
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.symbols import Symbols


@observer("savgol")
class SavitzkyGolayFilter(Differentiator, LastSamples, SteppedObserver[DerivativeForm, DerivativeCopy]):
    """Causal Savitzky-Golay differentiator, for lower triangular plants with one output.

    A polynomial c_0 + c_1 (t - t_k) + ... + c_p (t - t_k)^p is fitted to the last ``window`` samples, at whatever
    times they were taken, by least squares. At the newest one

        z_i = i! c_i,    i = 0 .. n-1

    are the output and its derivatives, and the estimate is the state that belongs to them, as for ``levant``. It is
    held until the next sample. With samples of a constant period the weights are those of Savitzky and Golay at the end
    of the window. Before there are samples at p + 1 times z is what it is at ``initial``, with the inputs at the start;
    until the window is full the polynomial is fitted to those that there are. A continuous output is measured at the
    ends of the solver's steps, which have to be given.

    It knows nothing of the plant's equations: a wide window averages the noise and lags behind what is not a polynomial
    of degree p, and a narrow one does the opposite. White noise of the standard deviation s leaves s |w| in z_i, w
    being the weights. It is a baseline: an observer that knows the model should be better.
    """

    reference = "Savitzky, Golay 1964"
    form = staticmethod(derivative_form)
    lacks = NO_MODEL

    window: int = Field(ge=2, le=501, strict=True, description="number of samples, more than the degree")
    degree: int = Field(default=2, ge=0, le=9, strict=True, description="of the polynomial, n - 1 or more")

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        n = form.plant.n
        if self.degree < n - 1:
            raise Problem(("degree",), f"{n} states take derivatives up to {n - 1}: expected that degree or more")
        if self.window <= self.degree:
            raise Problem(("window",), f"a polynomial of degree {self.degree} takes {self.degree + 1} samples or more")
        return {}

    def correct(self, plant: DerivativeCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y, age, there = self.with_newest(s, arrival)
        span = ca.fmax(ca.mmax(there * age), TINY)
        c, independent = _fit([there * (-age / span) ** j for j in range(self.degree + 1)], there * y)
        z = ca.vertcat(*[factorial(i) * c[i] / span**i for i in range(s.xhat.numel())])
        return {"xhat": ca.if_else(independent, z, s.xhat), "y": y, "age": age, "there": there}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"window": 2 * len(states) + 1, "degree": len(states)}


def _fit(columns: list[ca.SX], y: ca.SX) -> tuple[list[ca.SX], ca.SX]:
    """Coefficients of the least squares, by the modified Gram-Schmidt process, and whether they are determined."""
    parts, count = list(projections(columns, y)), len(columns)
    found: list[ca.SX] = [ca.SX(0)] * count
    for j in reversed(range(count)):
        R = parts[j].slopes
        found[j] = (parts[j].size - sum(R[i - j] * found[i] for i in range(j + 1, count))) / R[0]
    return found, parts[-1].independent
