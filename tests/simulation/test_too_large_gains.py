"""Gains that follow errors or the plant, too large for how rarely outputs come: named, with what would not be."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import Block, chain, simulated
from scipy.linalg import expm, solve_continuous_are

from hgorun.result.records.observer import ObserverResult

PERIOD = 0.1
LARGE = r"since large errors grow: they do not with"
SMALL = r"since even small errors grow: they do not with"
WHOLE = r"since errors that the whole gain corrects grow: they do not with"
LESS = "; take less, since it also corrects with parts of that gain"
CASES: dict[str, tuple[Block, str]] = {  # theta T of three integrators: 2.896, with filters 2.855 and 1.307
    "switched": (
        {"theta_1": 50, "theta_2": 5, "delta": 0.05},
        f"theta_1 = 50 .*{LARGE} theta_1 of at most 28, .* 0.057 s",
    ),
    "updated": (
        {"theta_0": 40, "theta_max": 60, "a": 50, "delta": 0.05},
        f"theta_max = 60 .*{LARGE} theta_max of at most 28 with theta_0 below it, .* 0.048 s",
    ),
    "dead_zone": ({"theta": 50}, f"theta = 50 .*{WHOLE} theta of at most 28, .* 0.057 s{LESS}"),
    "stubborn": ({"theta": 50}, f"theta = 50 .*{WHOLE} theta of at most 28, .* 0.057 s{LESS}"),
    "shgo_riccati": ({"theta": 50}, f"theta = 50 .*{SMALL} theta of at most 28, .* 0.057 s"),
    "fhgo1": ({"theta": 50, "delta": 3}, f"theta = 50 .*{SMALL} theta of at most 13, .* 0.026 s"),
    "fhgo2_nuos": ({"theta": 50, "r": 1}, f"theta = 50 .*{SMALL} theta of at most 28, .* 0.057 s"),
}
FEW = ("switched", "updated", "dead_zone")


def reason(n: int, observer: Block) -> str:
    block = {**observer, "initial": {"x1": 1}}
    measurement = {"sampling": {"period": PERIOD}}
    found = simulated(chain(n), {"S": block}, measurement=measurement, end=4, output_step=0.1, step=0.005)
    assert found.observers["S"].status == "diverged"
    return found.observers["S"].reason or ""


@pytest.mark.parametrize("kind", [*FEW, *(pytest.param(k, marks=pytest.mark.slow) for k in CASES if k not in FEW)])
def test_the_limits_are_those_of_three_integrators(kind: str) -> None:
    keys, expected = CASES[kind]
    found = reason(3, {"type": kind, **keys})
    assert re.search(expected + "$", found), found


def test_the_period_of_a_kalman_filter_is_that_of_its_gain_at_rest() -> None:
    """The largest eigenvalue of a period, with the gain of the Riccati equation; told in two digits, rounded down."""
    q, R = 1e6, 0.01
    A, C = np.array([[0.0, 1], [0, 0]]), np.array([[1.0, 0]])
    K = solve_continuous_are(A.T, C.T, np.diag([0, q]), np.array([[R]])) @ C.T / R
    M = np.block([[A, -K], [np.zeros((1, 2)), -K[:1]]])  # e' = -K_1 e between samples, and e = C (xhat - x) at one

    def radius(T: float) -> float:
        E = expm(M * T)
        return float(np.max(np.abs(np.linalg.eigvals(E[:2, :2] + E[:2, 2:] @ C))))

    low, high = 1e-3, PERIOD
    for _ in range(40):
        low, high = (middle, high) if radius(middle := (low + high) / 2) < 1 else (low, middle)
    found = reason(2, {"type": "kalman_bucy", "Q": {"x2": q}, "R": R})
    rate = float(np.max(np.abs(np.linalg.eigvals(A - K @ C))))
    said = re.search(r"as fast as ([0-9.]+) per s, .*they do not with a period of at most ([0-9.]+) s$", found)
    assert said is not None, found
    assert float(said[1]) == pytest.approx(rate, rel=1e-2)
    assert 0 <= low - float(said[2]) < 1.1e-3


def test_of_a_period_and_a_delay_both_are_told_where_there_is_no_gain_to_take() -> None:
    """What is advised settles, and somewhat more does not."""
    block: Block = {"type": "kalman_bucy", "Q": {"x2": 1e6}, "R": 0.01, "initial": {"x1": 1}}

    def found(part: float) -> ObserverResult:
        late = {"sampling": {"period": part * 0.1}, "delay": part * 0.2}
        more: Block = {"end": 4 * max(part, 0.1), "output_step": 0.05, "step": 0.005 * part}
        return simulated(chain(2), {"S": block}, measurement=late, **more).observers["S"]

    said = re.search(
        r"they do not with a period of at most (\S+) s and a delay of at most (\S+) s$", found(1.0).reason or ""
    )
    assert said is not None, found(1.0).reason
    period, delay = map(float, said.groups())
    assert delay == pytest.approx(2 * period, rel=0.1)
    part = min(period / 0.1, delay / 0.2)
    slow, fast = (np.max(np.abs(found(one * part).xhat[-1])) for one in (0.95, 1.5))
    assert slow < fast
