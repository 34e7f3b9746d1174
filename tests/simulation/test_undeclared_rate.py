"""Observers that do not say how fast they are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import simulated

from hgorun.observers.base import OBSERVERS, ContinuousObserver, Flow
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


class Silent(ContinuousObserver):
    """A high gain observer without ``fastest_rate``; the one of theta = 200 is fast."""

    theta: float = 200.0

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"K": np.array([2 * self.theta, self.theta**2])}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat) - k.K * e})


@pytest.fixture
def silent() -> Iterator[str]:
    with OBSERVERS.replaced("silent", Silent):
        yield "silent"


PLANT: dict[str, Any] = {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}}


def test_an_undeclared_rate_is_no_rate(silent: str) -> None:
    slow = simulated(PLANT, {"S": {"type": silent, "theta": 2.0}}, end=10)
    twin = simulated(PLANT, {"S": {"type": "shgo", "theta": 2.0}}, end=10)
    assert slow.status == "ok"
    np.testing.assert_allclose(slow.observers["S"].xhat, twin.observers["S"].xhat, atol=1e-5)


def test_steps_too_long_for_an_undeclared_rate_are_told(silent: str) -> None:
    observer = simulated(PLANT, {"S": {"type": silent}}, end=10, step=0.05).observers["S"]
    assert observer.status == "inaccurate"
    assert observer.reason is not None
    assert observer.reason.startswith("diverges with steps of 0.05, but not with shorter ones")
