"""A theta that is too large, of observers that choose among gains: the limit is that of an observer with this gain."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, simulated

from hgorun.errors import HgorunError
from hgorun.result.records.observer import ObserverResult
from hgorun.simulation.divergence import too_large

PERIOD, LATE = {"sampling": {"period": 0.1}}, {"delay": 0.1}
START: Block = {"initial": {"x1": 1}}
# three integrators: theta T and theta d from which on errors grow, as in the test of one theta
OF_PERIOD, OF_DELAY = 28.96, 9.27
OF_MODE = " is too large for the {} 0.1 s, since even small errors grow in this mode: they do not with"
OF_AEKF = (
    "theta = 50, which follows from theta_1 = 25, is too large for the delay 0.1 s, since even small errors grow as "
    "long as theta is 2 theta_1, which they keep it at: they do not with"
)


def bank(*thetas: float) -> Block:
    return {"type": "bank", "observer": {"type": "shgo"}, "thetas": list(thetas), **START}


def aekf(theta_1: float) -> Block:
    return {"type": "aekf", "theta_1": theta_1, "m": 1e-3, **START}


def found(block: Block, measurement: Block, step: float = 0.005, end: float = 4) -> tuple[ObserverResult, float]:
    """And the error at the end."""
    result = simulated(chain(3), {"S": block}, measurement=measurement, end=end, step=step)
    (one,) = result.observers.values()
    return one, float(np.max(np.abs(one.xhat[-1] - result.x[-1])))


@pytest.mark.costly
@pytest.mark.parametrize(
    ("block", "measurement", "reason"),
    [
        (
            bank(50, 10),
            PERIOD,
            f"theta = 50{OF_MODE.format('period')} thetas of at most 28, or a period of",
        ),
        (bank(50), LATE, f"theta = 50{OF_MODE.format('delay')} thetas of at most 9.2, or a delay of at most 0.018 s"),
        (aekf(25), LATE, f"{OF_AEKF} theta_1 of at most 3.9, or a delay of at most 0.015 s"),
    ],
    ids=["sampled bank", "late bank", "aekf"],
)
def test_what_is_too_large_is_named_with_its_limit(block: Block, measurement: Block, reason: str) -> None:
    one, _ = found(block, measurement, end=20)
    assert one.status == "diverged"
    assert one.reason is not None
    assert reason in one.reason


def test_modes_of_given_gains_have_the_theta_of_their_observer() -> None:
    block: Block = {"type": "bank", "observer": {"type": "shgo", "theta": 50}, "gains": [[3, 3, 1]], **START}
    one, _ = found(block, PERIOD)
    assert one.status == "diverged"
    assert one.reason is not None
    assert f"{OF_MODE.format('period')} observer.theta of at most 28, or a period of" in one.reason


def test_a_mode_that_cannot_stand_alone_is_not_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise HgorunError("it needs more")

    monkeypatch.setattr(too_large, "prepare", refuse)
    one, _ = found(bank(50), PERIOD)
    assert one.status == "diverged"
    assert "too large for the period" not in (one.reason or "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "limit", "measurement"),
    [(bank, OF_PERIOD, PERIOD), (bank, OF_DELAY, LATE), (aekf, 9.85, PERIOD), (aekf, 3.95, LATE)],
    ids=["sampled bank", "late bank", "sampled aekf", "late aekf"],
)
def test_errors_decay_below_the_limit_and_grow_above_it(of: object, limit: float, measurement: Block) -> None:
    assert callable(of)
    less, error = found(of(0.95 * limit), measurement, step=0.001, end=40)
    assert less.status == "ok"
    assert error < 0.05  # of hundreds at the peak
    more, _ = found(of(1.1 * limit), measurement, step=0.001, end=40)
    assert more.status == "diverged"
