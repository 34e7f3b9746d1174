"""Chains of several outputs that are followed at speeds of their own."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from hgorun.config.nearest import among
from hgorun.config.types import Name, Positive
from hgorun.errors import Problem
from hgorun.observers.constant_gain import PlacedGain
from hgorun.symbolic.canonical import CanonicalForm


class ChainSpeed(PlacedGain):
    """The key ``speed`` of an observer with one theta for the chains of all outputs.

    A chain with speed lambda has the poles of the others times lambda: lambda^i g_i in place of g_i, which is theta
    lambda in place of theta. A - G C stays Hurwitz, and that is all that the theory asks of G.
    """

    speed: dict[Name, Positive] | None = Field(
        default=None,
        description="with several outputs {output: number > 0}: the poles of its chain are multiplied by it (1)",
    )

    def chain_gains(self, form: CanonicalForm, filter_order: int = 0) -> tuple[np.ndarray, np.ndarray]:
        K_r, K_n = super().chain_gains(form, filter_order)
        speeds = self.speeds(form)
        powers = np.concatenate([np.arange(1, length + 1) for length in form.chains])
        K_r = K_r * speeds ** np.arange(1, filter_order + 1)[:, None]
        return K_r, K_n * np.repeat(speeds, form.chains) ** (filter_order + powers)

    def largest_pole(self, form: CanonicalForm, filter_order: int = 0) -> float:
        return super().largest_pole(form, filter_order) * float(np.max(self.speeds(form)))

    def speeds(self, form: CanonicalForm) -> np.ndarray:
        """Of every chain, shape (q,).

        Raises
        ------
        Problem
            For an output that there is not.
        """
        given, outputs = self.speed or {}, form.plant.outputs
        for output in given:
            if output not in outputs:
                raise Problem(("speed", output), f"no output of the plant; there are {among(output, outputs)}")
        return np.array([given.get(output, 1.0) for output in outputs])
