"""Poles that follow from theta and the time between samples."""

from __future__ import annotations

import cmath
import math

import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.constant_gain import ConstantGain

PLATEAU, LARGEST = 1.1, 1.8


def damping(theta_T: float) -> float:
    """zeta of s^2 + 2 zeta s + 1, theta T being theta times the time between samples.

    A double integrator is accelerated by white noise and measured at every T; theta is the one that is best for the
    position between samples. The zeta that is then best for the velocity between samples is (1 + theta T/2)/sqrt(2)
    to within 0.05 for theta T up to 2: Butterworth's poles, those of the continuous Kalman filter, where a correction
    takes many samples; a fast real pole for the position beside a slow one, where it has to be over within a gap. An
    acceleration that lasts longer than a gap asks for less damping. Between theta T = 1.1 and 2.2, 1.1 is within 6 % of
    the Kalman filter for white noise; from there on it would be 6 % worse than the best zeta in both, which grows to
    1.8 and beyond.
    """
    return min(LARGEST, max(min((1 + theta_T / 2) / math.sqrt(2), PLATEAU), theta_T / 2))


class SampledPoles(ConstantGain):
    """The key ``poles_for_period`` of an observer that is corrected in a flow from samples."""

    poles_for_period: Positive | None = Field(
        default=None,
        description="instead of poles, for chains of two states: the time between samples, from which they follow",
    )

    @model_validator(mode="after")
    def _follow(self) -> SampledPoles:
        if self.poles_for_period is not None:
            if "poles" in self.model_fields_set or self.gains is not None:
                raise ValueError("give only one of poles, gains and poles_for_period")
            zeta = damping(self.theta * self.poles_for_period)
            root = cmath.sqrt(zeta**2 - 1)
            object.__setattr__(self, "poles", (-zeta + root, -zeta - root))  # the block is frozen
        return self

    @property
    def poles_given(self) -> bool:
        return super().poles_given and self.poles_for_period is None

    def gain(self, order: int) -> np.ndarray:
        if self.poles_for_period is not None and order != 2:
            raise Problem(("poles_for_period",), f"only for chains of two states; here a chain has {order}: give poles")
        return super().gain(order)
