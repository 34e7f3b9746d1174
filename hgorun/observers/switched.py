"""The high-gain observer that switches between two gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Name, NonNegative, Positive
from hgorun.errors import Problem
from hgorun.observers.base import DecidedObserver, Flow, Role, observer
from hgorun.observers.capabilities import GainOfErrors, LocallyLinear, Speed
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.extension import Extendable
from hgorun.observers.threshold import HARDLY_MORE, NoiseThreshold, falling
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

_DWELL = 3.0  # of 1/theta_1
_STEPS = 10  # in a dwell time, at least
_ROUNDING = 1e-9  # relative, of sums of steps


@observer("switched")
class SwitchedObserver(GainOfErrors, Speed, NoiseThreshold, LocallyLinear, PlacedGain, Extendable, DecidedObserver):
    """High-gain observer with a fast gain for the transient and a slow one for noise.

    For uniformly observable plants. It is the standard observer with theta_1 in mode 1, in which it starts, and with
    theta_2 < theta_1 in mode 2:

        1 -> 2    once |e| <= delta has held for the time ``dwell``
        2 -> 1    when |e| > delta

    e the innovation, of several outputs each against its delta. The estimate is not reset. Both are decided at the
    ends of the solver's steps, on the innovation there, and after each sample; the mode holds over the next step, so
    that switches come up to a step late, and the error of the run is of the order of the step. ``dwell`` has passed
    when an unbroken run of steps that end with |e| <= delta is that long, the first one counted whole. Steps longer
    than dwell/10 are refused; automatic ones are shorter. Between switches the error obeys one of two linear systems.

    delta > amplitude of the noise keeps it in mode 2; by default delta is 1.5 times that amplitude and dwell is
    3/theta_1. Samples and late outputs come through the common innovation, without a theorem for them. Choose it for
    plants with rare, large disturbances; ``piecewise`` needs no decision, ``updated`` moves theta smoothly. Internal
    states: ``mode``, and ``calm``, the time since |e| > delta was last seen.
    """

    reference = "Ahrens, Khalil 2009, quoted from memory"

    theta_1: Positive = Field(description="high gain of the transient, theta_1 > theta_2")
    theta_2: Positive = Field(description="high gain afterwards, theta_2 > 0")
    delta: Positive | dict[Name, Positive] | None = Field(
        default=None,
        description="innovation above which mode 1 is taken, in the units of the output: a number > 0, or {output: "
        "number}; by default 1.5 times the amplitude of the noise",
    )
    dwell: NonNegative | None = Field(
        default=None, description="time for which |e| <= delta before mode 2 is taken, >= 0; 3/theta_1 by default"
    )

    @property
    def speed_key(self) -> str | None:
        return "theta_2"

    @property
    def speed_keys(self) -> tuple[str, ...]:
        return "theta_1", "theta_2"

    def at_speed(self, key: str, value: float) -> Self:
        """Errors of each mode are those of ``shgo`` with its theta."""
        return self.model_copy(update={"theta_1": HARDLY_MORE * value, "theta_2": value, "internal": {}})

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta_1": 4.0, "theta_2": 2.0, "delta": 0.05}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        thetas = falling(self.theta_1, self.theta_2)
        start = self.internal.get("mode", 1)
        if start not in (1, 2):
            raise Problem(("internal", "mode"), f"expected 1, the fast gain, or 2, the slow one; found {start}")
        _, G = self.chain_gains(form)
        return {
            **thetas,
            "dwell": np.array(self._dwell),
            "delta": self.threshold(form, "delta", self.delta),
            "G": G,
        }

    @property
    def _dwell(self) -> float:
        return _DWELL / self.theta_1 if self.dwell is None else self.dwell

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray]:
        return {"mode": np.array(1.0), "calm": np.array(0.0)}

    def roles(self, form: CanonicalForm) -> dict[str, Role]:
        return {"mode": "gain", "calm": "gain"}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        theta = ca.if_else(s.mode > 1.5, k.theta_2, k.theta_1)
        kappa = theta * plant.inv_Delta(theta) @ (k.G * plant.along_chains(e))
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, theta),
                "mode": ca.SX(0),
                "calm": ca.SX(1),
            },
            correction=plant.felt(s.xhat, kappa, theta),
        )

    def decide(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> dict[str, ca.SX]:
        large = ca.mmax(ca.fabs(e) / k.delta) > 1
        passed = s.calm >= (1 - _ROUNDING) * k.dwell
        return {
            "mode": ca.if_else(large, 1, ca.if_else(passed, 2, s.mode)),
            "calm": ca.if_else(large, 0, s.calm),
        }

    @property
    def nonlinear(self) -> str | None:
        return "the gain is that of theta_1 in mode 1"

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        return s.mode < 1.5

    def longest_step(self, form: CanonicalForm) -> float:
        return self._dwell / _STEPS if self._dwell > 0 else float("inf")

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self.theta_1 * self.largest_pole(form)

    def error_rate(self, form: CanonicalForm) -> float:
        return self.theta_2 * self.largest_pole(form)
