"""A theta that is too large where outputs are sampled at times of their own, or late samples are gone back to.

Beside a plain product of exponentials: with e the innovations, which an output predictor carries from sample to sample,
errors of two chains of two states follow xi' = A xi - K e, e' = -2 theta e, and e_i = C_i xi at a sample of output i.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import Block, chain, inline, simulated
from recordings import recording, signal, source
from scipy.linalg import expm

from hgorun.estimate.estimate import estimate
from hgorun.simulation.error_dynamics.apart import Apart

FREE = inline({"a": "b", "b": "0", "c": "d", "d": "0"}, {"y": "a", "z": "c"})
COUPLED = inline({"a": "b", "b": "-a + 2*c", "c": "d", "d": "0.5*a - d"}, {"y": "a", "z": "c"})
SLOPES = {
    "free": np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]]),
    "coupled": np.array([[0, 1, 0, 0], [-1, 0, 2, 0], [0, 0, 0, 1], [0.5, 0, 0, -1]]),
}
PLANTS = {"free": FREE, "coupled": COUPLED}
BESIDE = {"a": 1.0, "c": 1.0}


def last_size(A: np.ndarray, times: list[np.ndarray], theta: float) -> float:
    """Of the errors after all samples, of those that begin with the size of 1."""
    G = np.zeros((6, 6))
    G[:4, :4] = A
    for i in range(2):
        G[2 * i, 4 + i], G[2 * i + 1, 4 + i], G[4 + i, 4 + i] = -2 * theta, -(theta**2), -2 * theta
    state, now = np.array([1.0, 0, 1, 0, 0, 0]), 0.0
    for t in np.unique(np.concatenate(times).round(9)):
        state, now = expm(G * (t - now)) @ state, t
        for i, own in enumerate(times):
            if np.min(np.abs(own - t)) < 1e-6:
                state[4 + i] = state[2 * i]
    return float(np.max(np.abs(state[:4])))


def advised(reason: str | None, what: str) -> float:
    found = re.search(
        rf"theta = 80 is too large for {what}, since .*: they do not with theta of at most (\S+), or", str(reason)
    )
    assert found is not None, reason
    return float(found[1])


@pytest.mark.parametrize(
    ("plant", "periods", "offset", "what"),
    [
        ("free", (0.1, 0.2), 0.0, "the periods 0.1 s of y and 0.2 s of z"),
        ("coupled", (0.1, 0.15), 0.05, "the periods 0.1 s of y and 0.15 s of z"),
        ("coupled", (0.1, 0.1), 0.04, "the period 0.1 s of outputs that are not sampled together"),
    ],
)
def test_the_limit_is_that_of_all_samples(plant: str, periods: tuple[float, float], offset: float, what: str) -> None:
    sampling: Block = {"y": {"period": periods[0]}, "z": {"period": periods[1], "offset": offset}}
    measurement = {"outputs": {name: {"sampling": one} for name, one in sampling.items()}}
    found = simulated(
        PLANTS[plant],
        {"S": {"type": "shgo", "theta": 80, "initial": BESIDE}},
        end=6,
        step=0.01,
        measurement=measurement,
    ).observers["S"]
    assert found.status == "diverged"
    limit = advised(found.reason, what)
    times = [np.arange(0, 30, periods[0]), np.arange(offset, 30, periods[1])]
    assert last_size(SLOPES[plant], times, 0.97 * limit) < 1e-2
    assert last_size(SLOPES[plant], times, 1.07 * limit) > 1e2


def test_of_recorded_samples_it_is_that_of_their_own_times() -> None:
    """Irregular ones, of which the limit of the usual gaps is not known."""
    rng = np.random.default_rng(2)
    times = [np.cumsum(rng.uniform(0.06, 0.14, 60)).round(3), np.cumsum(rng.uniform(0.1, 0.2, 40)).round(3)]
    text: Block = {
        "plant": COUPLED,
        "observers": {"S": {"type": "shgo", "theta": 80, "initial": BESIDE}},
        "solver": {"step": 0.01, "divergence": 1e6},
    }
    log = recording(*(signal(name, own, 0 * own) for name, own in zip("yz", times, strict=True)))
    reason = estimate(source(text), log, sensitivity=False).observers["S"].reason
    limit = advised(reason, r"the periods 0\.\d+ s of y and 0\.\d+ s of z")
    end = min(own[-1] for own in times)
    many = [np.concatenate([own[own < end] + k * end for k in range(8)]) for own in times]
    assert last_size(SLOPES["coupled"], many, 0.95 * limit) < 1e-2
    assert last_size(SLOPES["coupled"], many, 1.1 * limit) > 1e2


@pytest.mark.costly
@pytest.mark.parametrize("delay", [0.05, 0.3])
def test_errors_of_late_samples_that_are_gone_back_to_grow_in_the_past(delay: float) -> None:
    """The limit is that of the period, 4.995 of theta T, whatever the delay; it is right in simulations."""

    def run(theta: float, end: float) -> tuple[float, str | None]:
        block: Block = {"type": "shgo", "theta": theta, "late": "replay", "initial": {"x1": 1}}
        measurement = {"sampling": {"period": 0.1}, "delay": delay}
        result = simulated(
            chain(2, start=0.0), {"S": block}, measurement=measurement, end=end, output_step=0.1, step=0.02
        )
        found = result.observers["S"]
        size = np.max(np.abs(found.xhat), axis=1)
        return float(np.max(size[-5:]) / np.max(size[:20])), found.reason

    _, reason = run(80, 4)
    assert advised(reason, "the period 0.1 s") == 49
    assert run(0.95 * 49.95, 24)[0] < 1e-2
    size, reason = run(1.05 * 49.95, 24)
    assert np.isnan(size)
    assert "theta = 52.45 is too large for the period 0.1 s" in str(reason)


def test_periods_without_a_common_multiple_are_not_judged() -> None:
    assert Apart.of_periods({"y": 0.1, "z": 0.1 * np.pi}, [0.0, 0.0]) is None
    assert Apart.of_periods({"y": 0.1, "z": 6.5}, [0.0, 0.0]) is None
    assert Apart.of_samples([np.ones(1), np.ones(1)], {"y": 1.0, "z": 1.0}) is None


@pytest.mark.costly
def test_theta_of_a_filter_on_chains_is_told_of() -> None:
    """At 0.95 of the limit errors vanish, at 1.03 times the limit the filter is lost, and told."""
    blocks: dict[str, Block] = {
        label: {"type": "kalman_bucy", "theta": theta, "R": 1.0, "initial": {"x1": 1}}
        for label, theta in (("slower", 13.3), ("faster", 14.5))
    }
    measurement: Block = {"sampling": {"period": 0.1}}
    found = simulated(
        chain(3, start=0.0), blocks, measurement=measurement, end=40, output_step=0.1, step=0.01
    ).observers
    size = np.max(np.abs(found["slower"].xhat), axis=1)
    assert np.max(size[-10:]) < 1e-3 * np.max(size[:20])
    assert "theta = 14.5 is too large for the period 0.1 s" in str(found["faster"].reason)
    assert "theta of at most 14, or a period" in str(found["faster"].reason)
