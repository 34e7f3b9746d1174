"""Streams of random logs, checkpointed and restored at random moments: the bits of the file at the same times."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_logs import END, estimated, random_input, random_samples, written
from plain_observers import Input

from hgorun.estimate.stream.estimator import Estimator

GRID = 1 / 32  # of all times, and two steps: these are the same to the last bit, wherever a late sample was taken
PAIR: Block = {
    "states": list("abcd"),
    "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b + u"},
    "output": ["a", "c"],
}
FLOWING: dict[str, Block] = {
    "fhgo2": {"theta": 2, "r": 2},
    "fhgo1": {"theta": 1.5, "delta": 4},
    "updated": {"theta_0": 1, "theta_max": 4, "delta": 0.3},
    "stubborn": {"theta": 2, "lam": 0.7, "rho": 1.5, "internal": {"sigma": 0.3}},
}
FILTER: Block = {"Q": {"b": 0.3, "d": 0.2}, "R": {"a": 0.3, "c": 0.4}}
JUMPING: dict[str, Block] = {
    "impulsive": {"theta": 1},
    "impulsive_riccati": {"theta": 1},
    "ekf": FILTER,
    "ukf": {**FILTER, "kappa": 0},
}
TREATED = {"innovation": FLOWING, "replay": {**FLOWING, **JUMPING}}


def on_grid(t: float) -> float:
    return round(t / GRID) * GRID


def compared(kinds: list[str], late: str, seed: int, folder: Path) -> None:
    samples = [(on_grid(t), on_grid(k), i, y) for t, k, i, y in random_samples(seed, [0.15, 0.4])]
    samples = list({(t, i): (t, k, i, y) for t, k, i, y in samples if t < END}.values())
    drawn = random_input(seed)
    times = sorted({on_grid(t) for t in drawn.times})
    u = Input(times, drawn.values[: len(times)])
    start = {"a": 0.8, "b": 0.1, "c": 0.3, "d": -0.2}
    observers = {one: {"type": one, **TREATED[late][one], "initial": start, "late": late} for one in kinds}
    config: Block = {
        "plant": PAIR,
        "time": {"start": 0, "end": END, "output_step": GRID},
        "solver": {"method": "rk4", "step": GRID / 2},
        "observers": observers,
        "data": written(folder, samples, "ac", {"u": u}),
    }
    expected = estimated(folder, config)
    chance, estimator = random.Random(seed), Estimator.load(folder / "config.yaml")
    for t in np.arange(0, END + GRID / 2, GRID).tolist():
        if t in times:
            estimator.update(t, {}, u={"u": u(t, t)})
        for taken, known, i, y in sorted(samples):
            if known == t:
                estimator.update(taken, {"ac"[i]: y}, available=known)
        if chance.random() < 0.1:
            stored, estimator = estimator.checkpoint(), Estimator.load(folder / "config.yaml")
            estimator.restore(stored)
        if any(t == known for _, known, *_ in samples):
            for label, xhat in estimator.estimate().items():
                np.testing.assert_array_equal(xhat, expected[label][round(t / GRID)], err_msg=f"{label} at {t}")


@pytest.mark.costly
@pytest.mark.parametrize(("late", "kinds"), [("innovation", ["fhgo2", "stubborn"]), ("replay", ["fhgo2", "ekf"])])
def test_a_restored_stream_has_the_bits_of_a_random_log(late: str, kinds: list[str], tmp_path: Path) -> None:
    compared(kinds, late, 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("late", TREATED)
def test_restored_streams_have_the_bits_of_further_random_logs(late: str, tmp_path: Path) -> None:
    for seed in range(2, 6):
        folder = tmp_path / str(seed)
        folder.mkdir()
        compared(list(TREATED[late]), late, seed, folder)
