"""Estimates of random logs beside plain integrations: what constant and changing gains and covariances correct."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_corrections import (
    Chains,
    KalmanBucy,
    Law,
    LowPower,
    homogeneous,
    integral,
    lowpass,
    piecewise,
    prescribed_time,
    standard,
    super_twisting,
    treangle,
    updated,
    zone,
)
from plain_jumps import ExtendedKalman, Unscented
from plain_logs import estimated, expected, random_input, random_samples, written
from plain_observers import Array, Plain

from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

Case = tuple[Block, Plain, tuple[str, ...]]  # the observer's block, the same as plain NumPy, late samples
BOTH, BACK = ("innovation", "replay"), ("replay",)


def jerk(t: float, x: Array, u: float) -> Array:
    return np.array([x[1], x[2], -0.6 * x[2] - x[1] - np.sin(x[0]) + u])


def pair(t: float, x: Array, u: float) -> Array:
    a, b, c, d = x
    return np.array([b, -np.sin(a) + 0.3 * c - 0.1 * b, d, -c - 0.2 * a * b + u])


def sensors(t: float, x: Array, u: float) -> Array:
    return np.array([np.sin(x[0]) + 0.5 * x[1], x[2] + 0.3 * x[0]])


THREE, FOUR = {"a": 0.8, "b": 0.1, "c": 0.3}, {"a": 0.8, "b": 0.1, "c": 0.3, "d": -0.2}
JERK: Block = {"states": list("abc"), "dynamics": {"a": "b", "b": "c", "c": "-0.6*c - b - sin(a) + u"}, "output": "a"}
PAIR: Block = {
    "states": list("abcd"),
    "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b + u"},
    "output": ["a", "c"],
}
SENSORS: Block = {**PAIR, "output": {"y": "sin(a) + 0.5*b", "z": "c + 0.3*a"}}


def of_jerk(block: Block, law: Law, *kept: float, late: tuple[str, ...] = BOTH) -> Case:
    return block, Chains(jerk, [0], length=3, law=law, kept=kept), late


def of_pair(block: Block, law: Law, *kept: float, late: tuple[str, ...] = BOTH) -> Case:
    return block, Chains(pair, [0, 2], length=2, law=law, kept=kept), late


Q, R = np.diag([0, 0.3, 0.05, 0.2]), np.diag([0.3, 0.4])
FILTER: Block = {"Q": {"b": 0.3, "c": 0.05, "d": 0.2}, "R": {"y": 0.3, "z": 0.4}}
SCALED = 1.5 * np.diag([1, 1.5, 1.5**2]) ** 2
STUBBORN: Block = {"theta": 2, "lam": 0.7, "rho": 1.5, "internal": {"sigma": 0.3}}
FILTERED: Mapping[str, Case] = {
    "integral": of_jerk({"theta": 1.7, "r": 2}, integral(1.7, 3, 2), 0, 0),
    "lowpass": of_jerk({"theta": 1.7, "r": 2, "rho": 0.2}, lowpass(1.7, 3, 2, 0.2), 0, 0),
    "treangle": of_jerk({"theta": 2}, treangle(2, 3), 0, 0, 0),
    "low_power": (
        {"theta": 2, "saturate": [1, 1.5]},
        LowPower(jerk, [0], 2.0, phi=lambda t, x, u: jerk(t, x, u)[2], M=(1.0, 1.5)),
        BOTH,
    ),
    "hg_ekf": ({"theta": 1.5}, KalmanBucy(jerk, [0], Q=SCALED, R=np.eye(1) / 1.5), BOTH),
    "hg_ekf at samples": (
        {"theta": 1.5, "update": "jump", "interval": 0.2},
        ExtendedKalman(jerk, [0], Q=SCALED, R=np.eye(1) / (1.5 * 0.2)),
        BACK,
    ),
}
CHANGING: Mapping[str, Case] = {
    "updated": of_jerk(
        {"theta_0": 1, "theta_max": 4, "a": 1.5, "b": 0.3, "delta": 0.3}, updated(1, 4, 1.5, 0.3, 0.3, 3), 1
    ),
    "prescribed_time": of_jerk({"T": 1.5, "mu_max": 3}, prescribed_time(1.5, 3, 3), late=BACK),
    "homogeneous": of_jerk({"theta": 1.5, "d0": -0.2, "dinf": 0.3}, homogeneous(1.5, -0.2, 0.3, 3)),
}
IN_PAIRS: Mapping[str, Case] = {
    "piecewise": of_pair({"theta_1": 3, "theta_2": 1, "d": 0.4}, piecewise(3, 1, 0.4, 2)),
    "dead_zone": of_pair({"theta": 2, "lam": 0.7, "rho": 0.5}, zone(2, 0.7, 0.5, 2, stubborn=False), 0),
    "stubborn": of_pair(STUBBORN, zone(2, 0.7, 1.5, 2, stubborn=True), 0.3),
    "treangle": of_pair({"theta": 2}, treangle(2, 2), 0, 0),
    "shgo": (
        {"theta": 2, "hold": {"shrink": 1.5}},
        Chains(pair, [0, 2], length=2, law=standard(2, 2), shrink=1.5),
        BOTH,
    ),
    "super_twisting": of_pair({"f": 1.5}, super_twisting(1.5), late=BACK),
}
FILTERS: Mapping[str, Case] = {
    "kalman_bucy": (FILTER, KalmanBucy(pair, [0, 2], Q=Q, R=R, h=sensors), BOTH),
    "ekf": (FILTER, ExtendedKalman(pair, [0, 2], Q=Q, R=R, h=sensors), BACK),
    "ukf": (
        {**FILTER, "kappa": 0, "beta": 0.5, "alpha": 0.9},
        Unscented(pair, [0, 2], Q=Q, R=R, h=sensors, alpha=0.9, beta=0.5),
        BACK,
    ),
}
GROUPS: Mapping[str, tuple[Block, dict[str, float], Sequence[str], Sequence[float], Mapping[str, Case]]] = {
    "filtered": (JERK, THREE, "a", [0.2], FILTERED),
    "changing": (JERK, THREE, "a", [0.2], CHANGING),
    "in pairs": (PAIR, FOUR, "ac", [0.15, 0.4], IN_PAIRS),
    "filters": (SENSORS, FOUR, "yz", [0.15, 0.4], FILTERS),
}


def compared(group: str, names: Sequence[str], seed: int, folder: Path) -> None:
    plant, start, outputs, gaps, cases = GROUPS[group]
    samples, u = random_samples(seed, gaps, late=seed % 5 != 4), random_input(seed)
    blocks, wanted = {}, {}
    for name in names:
        block, plain, treatments = cases[name]
        for late in treatments:
            blocks[f"{name} {late}"] = {"type": name.partition(" ")[0], **block, "late": late, "initial": start}
            wanted[f"{name} {late}"] = expected(plain, samples, list(start.values()), u, late)
    data = written(folder, samples, outputs, {"u": u})
    found = estimated(folder, {"plant": plant, "observers": blocks, "data": data})
    for label, one in wanted.items():
        np.testing.assert_allclose(found[label], one, rtol=0, atol=1e-12 * np.max(np.abs(one)), err_msg=label)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("group", "names"),
    [
        ("filtered", ["integral", "low_power", "hg_ekf at samples"]),
        ("changing", ["updated", "prescribed_time"]),
        ("in pairs", ["stubborn", "shgo", "super_twisting"]),
        ("filters", ["kalman_bucy", "ukf"]),
    ],
)
def test_estimates_of_a_random_log(group: str, names: Sequence[str], tmp_path: Path) -> None:
    compared(group, names, list(GROUPS).index(group), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_estimates_of_further_random_logs(group: str, tmp_path: Path) -> None:
    for seed in range(4, 14):
        compared(group, list(GROUPS[group][-1]), seed, tmp_path)


@pytest.mark.measured("prescribed_time-block0")
@pytest.mark.costly
@pytest.mark.parametrize(
    ("kind", "block"),
    [
        ("prescribed_time", {"T": 1.5, "mu_max": 3}),
        ("super_twisting", {"f": 1.5}),
        ("eso", {"omega_o": 2}),
        ("red", {"L": 1}),
    ],
)
def test_observers_that_cannot_bridge_a_delay_refuse_late_samples(kind: str, block: Block, tmp_path: Path) -> None:
    """As in simulations; what is left out, or gone back to, is not late to them."""
    plant: Block = {"states": list("ab"), "dynamics": {"a": "b", "b": "-a"}, "output": "a"}
    samples = [(0.25 * k, 0.25 * k + 0.4 * (k == 3), 0, 1.0) for k in range(8)]
    config = {"plant": plant, "data": written(tmp_path, samples, "a", {})}
    with pytest.raises(ConfigError, match=f"observers.O: {kind} takes outputs without delay, but a is late"):
        estimated(tmp_path, {**config, "observers": {"O": {"type": kind, **block}}})
    for late in ("drop",) if kind == "red" else ("drop", "replay"):
        estimated(tmp_path, {**config, "observers": {"O": {"type": kind, **block, "late": late}}})
    time = {"start": 0, "end": 2, "output_step": 1}
    run = {"plant": {**plant, "initial": {"a": 1, "b": 0}}, "time": time, "solver": {"method": "rk4", "step": 0.01}}
    live = Estimator(Experiment({**run, "observers": {"O": {"type": kind, **block}}}), std={}, gates={})
    live.update(0.25, {"a": 1.0})
    with pytest.raises(ValueError, match=f"{kind} takes outputs without delay, but these are late"):
        live.update(0.5, {"a": 1.0}, available=0.9)
