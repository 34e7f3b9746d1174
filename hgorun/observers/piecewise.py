"""The high-gain observer with a piecewise linear correction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Name, NonNegative, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import LocallyLinear, Speed
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.extension import Extendable
from hgorun.observers.nested import clipped
from hgorun.observers.threshold import HARDLY_MORE, NoiseThreshold, falling
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

_BETWEEN = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 200)])  # gains of the sector that are looked at


@observer("piecewise")
class PiecewiseObserver(Speed, NoiseThreshold, LocallyLinear, PlacedGain, Extendable):
    """High-gain observer with one gain for small innovations and another for large ones.

    For uniformly observable plants. With e the innovation, sat_d(e) e cut off at +-d and dz_d(e) = e - sat_d(e) what
    is beyond, it subtracts in the coordinates of the chain

        v_i = theta_1^i g_i dz_d(e) + theta_2^i g_i sat_d(e),    theta_1 > theta_2

    so that theta_1 acts on large errors and makes their decay short, and theta_2 decides what becomes of noise
    smaller than d. By default d is 1.5 times the noise's amplitude. For n = 2 and phi = 0 it is stable for all
    theta_1, theta_2, d > 0, since V = int_0^e v_2 ds + e_2^2/2 has V' = -v_1 v_2; for n >= 3 a gain between the two
    could be unstable: A - (s theta_1^i g_i + (1 - s) theta_2^i g_i) C is looked at for s from 0 to 1, and refused
    where it is not Hurwitz, which is necessary and no proof. Samples and late outputs come through the common
    innovation; there is no theorem for them. d = 0 is ``shgo`` with theta_1, a large d that with theta_2. Choose it
    over ``switched`` where the correction should be a function of the innovation alone.
    """

    reference = "Prasov, Khalil 2013, quoted from memory"

    theta_1: Positive = Field(description="high gain of large errors, theta_1 > theta_2")
    theta_2: Positive = Field(description="high gain of small errors, theta_2 > 0")
    d: NonNegative | dict[Name, NonNegative] | None = Field(
        default=None,
        description="where the innovation is large, in the units of the output: d >= 0, or {output: d}; by default 1.5 "
        "times the amplitude of the noise",
    )

    @property
    def speed_key(self) -> str | None:
        return "theta_2"

    @property
    def speed_keys(self) -> tuple[str, ...]:
        return "theta_1", "theta_2"

    def at_speed(self, key: str, value: float) -> Self:
        """Errors beyond d are those of ``shgo`` with theta_1, as those within d are with theta_2."""
        return self.model_copy(update={"theta_1": HARDLY_MORE * value, "theta_2": value})

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta_1": 4.0, "theta_2": 2.0, "d": 0.1}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        thetas = falling(self.theta_1, self.theta_2)
        _, G = self.chain_gains(form)
        for length in set(form.chains):
            self._require_hurwitz(length)
        return {**thetas, "G": G, "d": self.threshold(form, "d", self.d)}

    def _require_hurwitz(self, n: int) -> None:
        """Every gain of the sector, in the time of theta_2."""
        g, faster = self.gain(n), (self.theta_1 / self.theta_2) ** np.arange(1, n + 1)
        for s in _BETWEEN:
            if not np.all(np.roots([1.0, *((s * faster + 1 - s) * g)]).real < 0):
                raise Problem(
                    ("theta_1",),
                    f"between the gains of theta_1 and theta_2 the error's matrix is not Hurwitz (s = {s:.3g}, n = "
                    f"{n}): bring the two closer together, or choose other poles",
                )

    @property
    def nonlinear(self) -> str | None:
        return "the gain is not that of theta_2 while |e| > d"

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        return ca.fabs(e) > k.d

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        small = clipped(e, k.d)
        large = e - small
        of_large = k.theta_1 * plant.inv_Delta(k.theta_1) @ (k.G * plant.along_chains(large))
        of_small = k.theta_2 * plant.inv_Delta(k.theta_2) @ (k.G * plant.along_chains(small))
        rate = plant.copy(s.xhat) - plant.lift(s.xhat, of_small, k.theta_2) - plant.lift(s.xhat, of_large, k.theta_1)
        felt = plant.felt(s.xhat, of_small, k.theta_2) + plant.felt(s.xhat, of_large, k.theta_1)
        return Flow({"xhat": rate}, correction=felt)

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self.theta_1 * self.largest_pole(form)

    def error_rate(self, form: CanonicalForm) -> float:
        return self.theta_2 * self.largest_pole(form)
