"""The high-gain observer whose gain grows with the innovation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Name, NonNegative, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.capabilities import GainOfErrors, LocallyLinear, Speed
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.extension import Extendable
from hgorun.observers.threshold import HARDLY_MORE, NoiseThreshold
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

_APART = 1e-3  # relative: theta counts as another one than theta_0


@observer("updated")
class UpdatedObserver(GainOfErrors, Speed, NoiseThreshold, LocallyLinear, PlacedGain, Extendable):
    """High-gain observer with a theta that grows while the innovation is large, and falls back.

    For uniformly observable plants. It is the standard observer with theta(t), theta(0) = theta_0,

        theta' = a theta (1 - theta/theta_max) clip(|e|/delta - 1, 0, 1) - b (theta - theta_0)

    which keeps theta between theta_0 and theta_max. |e| is that of the output that is furthest beyond its delta, by
    default 1.5 times the noise's amplitude; while |e| <= delta, theta falls back like exp(-b t). No term of theta'
    belongs into xhat': in the scaled error it is (theta'/theta) diag(0, .., n-1), and the error decays if max(a, b)
    (n-1) sqrt(cond P) < mu theta_0 with P (A - G C) + (A - G C)^T P <= -2 mu P, which is sufficient, not necessary.
    The defaults a = theta_0, b = theta_0/10, theta_max = 5 theta_0 do not always meet it. Samples and late outputs
    come through the common innovation; there is no theorem for them, and theta_max has to keep inside their limits. a
    = 0 is ``shgo``. Choose it where large errors come back again and again; ``dynamic_gain`` adapts theta to the
    plant's slopes instead.
    """

    reference = "after Sanfelice, Praly 2011, who adapt theta to the innovation; this law is our own"

    theta_0: Positive = Field(description="high gain at rest, theta_0 > 0")
    theta_max: Positive | None = Field(default=None, description="largest high gain, > theta_0; 5 theta_0 by default")
    a: NonNegative | None = Field(default=None, description="rate at which theta grows, a >= 0; theta_0 by default")
    b: Positive | None = Field(default=None, description="rate at which theta falls back, b > 0; theta_0/10 by default")
    delta: Positive | dict[Name, Positive] | None = Field(
        default=None,
        description="innovation above which theta grows, in the units of the output: a number > 0, or {output: "
        "number}; by default 1.5 times the amplitude of the noise",
    )

    @property
    def speed_key(self) -> str | None:
        return "theta_0"

    @property
    def speed_keys(self) -> tuple[str, ...]:
        return "theta_max", "theta_0"

    def speed_of(self, key: str) -> float:
        return self._largest if key == "theta_max" else self.theta_0

    def at_speed(self, key: str, value: float) -> Self:
        """Where theta rests at either end, errors are those of ``shgo`` with it."""
        return self.model_copy(update={"theta_0": value, "theta_max": HARDLY_MORE * value, "internal": {}})

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta_0": 2.0, "delta": 0.1}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        largest = self._largest
        if not largest > self.theta_0:
            raise Problem(("theta_max",), f"must be above theta_0 = {self.theta_0:g}, found {largest:g}")
        start = self.internal.get("theta", self.theta_0)
        if isinstance(start, float | int) and not self.theta_0 <= start <= largest:
            message = f"theta starts between theta_0 = {self.theta_0:g} and theta_max = {largest:g}, found {start:g}"
            raise Problem(("internal", "theta"), message)
        _, G = self.chain_gains(form)
        return {
            "theta_0": np.array(self.theta_0),
            "theta_max": np.array(largest),
            "a": np.array(self.theta_0 if self.a is None else self.a),
            "b": np.array(self.theta_0 / 10 if self.b is None else self.b),
            "delta": self.threshold(form, "delta", self.delta),
            "G": G,
        }

    @property
    def _largest(self) -> float:
        return 5 * self.theta_0 if self.theta_max is None else self.theta_max

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"theta": np.array(self.theta_0)}

    def roles(self, form: CanonicalForm) -> dict[str, Role]:
        return {"theta": "gain"}

    @property
    def nonlinear(self) -> str | None:
        return "theta is not theta_0 after |e| > delta"

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        return ca.vertcat(ca.fabs(e) > k.delta, s.theta > (1 + _APART) * k.theta_0)

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        kappa = s.theta * plant.inv_Delta(s.theta) @ (k.G * plant.along_chains(e))
        beyond = ca.fmax(0, ca.fmin(1, ca.mmax(ca.fabs(e) / k.delta) - 1))
        growth = k.a * s.theta * (1 - s.theta / k.theta_max) * beyond
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, s.theta),
                "theta": growth - k.b * (s.theta - k.theta_0),
            },
            correction=plant.felt(s.xhat, kappa, s.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._largest * self.largest_pole(form)

    def error_rate(self, form: CanonicalForm) -> float:
        return self.theta_0 * self.largest_pole(form)
