"""Which limits of the sampling are told of which observers, and which are not."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, findings
from scipy.linalg import expm

import hgorun
from hgorun.tables.advice import advice

SAMPLED: Block = {"sampling": {"period": 0.1}}


@pytest.mark.parametrize("late", ["replay", "drop"])
def test_no_limit_of_the_delay_where_late_samples_do_not_enter_the_innovation(late: str) -> None:
    """Also where the run has no delay: to an observer that goes back, or leaves late samples out, none are late."""
    blocks: Block = {"S": {"type": "shgo", "theta": 2, "late": late}, "T": {"type": "shgo", "theta": 2}}
    found = hgorun.analyze(
        experiment(chain(2, "-x1"), blocks, end=1, step=0.05, measurement=SAMPLED), findings("stability")
    ).observers
    for name in ("delay_critical", "delay_critical_chain"):
        assert found["T"].values[name] is not None
        assert f"late: {late}" in found["S"].reasons[name]
    for name in ("period_critical", "period_critical_chain"):
        assert found["S"].values[name] == found["T"].values[name]


def radius(theta: float, gamma: float, n: int) -> float:
    """Of (xi, e) from sample to sample, poles at -theta: xi' = N xi - K e, e' = -gamma e, e = xi_1 after a sample."""
    gains = np.poly([-1.0] * n)[1:] * theta ** np.arange(1, n + 1)
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n], M[n, n] = np.eye(n, k=1), -gains, -gamma
    flow = expm(0.1 * M)
    return float(np.max(np.abs(np.linalg.eigvals(flow[:n, :n] + flow[:n, n:] @ np.eye(1, n)))))


@pytest.mark.parametrize(("n", "gamma"), [(2, 5.0), (3, 1.0), (3, 0.0)])
def test_how_far_theta_may_go_where_the_innovation_shrinks_at_a_rate_of_its_own(n: int, gamma: float) -> None:
    block = {"type": "shgo", "theta": 1.5, "hold": {"shrink": gamma}}
    run = experiment(chain(n), {"S": block}, end=1, step=0.05, measurement=SAMPLED)
    text = " ".join("\n".join(advice(hgorun.analyze(run, findings("stability", "decay")))).split())
    told = float(text.split("stable up to theta = ")[1].split(",")[0])
    assert radius(0.998 * told, gamma, n) < 1 < radius(1.002 * told, gamma, n)
