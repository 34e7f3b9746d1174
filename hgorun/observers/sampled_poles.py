"""Poles that follow from theta and the time between samples."""

from __future__ import annotations

import cmath
import math
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.chain_speed import ChainSpeed
from hgorun.observers.constant_gain import ConstantGain
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.matrices import hurwitz_gain

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


class SampledPoles(ChainSpeed, ConstantGain):
    """The key ``poles_for_period`` of an observer that is corrected in a flow from samples.

    The poles follow from the theta of each chain, theta times its speed, whenever they are asked for: a copy of the
    observer with another theta has its own.
    """

    poles_for_period: Positive | None = Field(
        default=None,
        description="instead of poles, for chains of two states: the time between samples, from which they follow",
    )

    @model_validator(mode="after")
    def _one_key(self) -> SampledPoles:
        if self.poles_for_period is not None and ("poles" in self.model_fields_set or self.gains is not None):
            raise ValueError("give only one of poles, gains and poles_for_period")
        return self

    @property
    def poles_given(self) -> bool:
        return super().poles_given and self.poles_for_period is None

    @property
    def poles_follow(self) -> bool:
        return self.poles_for_period is not None

    def with_theta(self, theta: float) -> Self:
        copied = super().with_theta(theta)
        if self.poles_for_period is None:
            return copied
        return copied.model_copy(update={"poles_for_period": self.theta * self.poles_for_period / theta})

    def gain(self, order: int) -> np.ndarray:
        return super().gain(order) if self.poles_for_period is None else self._followed(order, 1.0)

    def gains_of_chains(self, form: CanonicalForm, filter_order: int = 0) -> list[np.ndarray]:
        if self.poles_for_period is None:
            return super().gains_of_chains(form, filter_order)
        orders = [filter_order + length for length in form.chains]
        return [self._followed(order, speed) for order, speed in zip(orders, self.speeds(form), strict=True)]

    def placed_poles(self, order: int) -> np.ndarray:
        if self.poles_for_period is None:
            return super().placed_poles(order)
        return np.resize(np.array(_pair(self.theta * self.poles_for_period)), order)

    def _followed(self, order: int, speed: float) -> np.ndarray:
        """The gain of a chain at the speed of 1."""
        assert self.poles_for_period is not None
        if order != 2:
            raise Problem(("poles_for_period",), f"only for chains of two states; here a chain has {order}: give poles")
        return hurwitz_gain(order, _pair(self.theta * float(speed) * self.poles_for_period))


def _pair(theta_T: float) -> tuple[complex, complex]:
    """The roots of s^2 + 2 zeta s + 1."""
    zeta = damping(theta_T)
    root = cmath.sqrt(zeta**2 - 1)
    return -zeta + root, -zeta - root
