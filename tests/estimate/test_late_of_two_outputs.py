"""Two outputs at rates of their own, known in any order, some at once and some never: beside plain integrations.

What late samples in the innovation give is integrated once, with what each of them was compared with held from when it
is known. What going back gives is integrated from the start for every time that is looked at, with the samples that are
known by then in the order in which they were taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from examples import Block
from recordings import recording, signal, source

from hgorun.estimate.estimate import estimate

STEP, END = 0.01, 4.0
START = {"a": 0.8, "b": 0.1, "c": 0.3, "d": 0.0}
Q = {"b": 0.01, "d": 0.02}
PLANT: Block = {
    "states": ["a", "b", "c", "d"],
    "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b + u"},
    "inputs": {"u": "0.5*sin(t)"},
    "output": ["a", "c"],
}
OBSERVERS: dict[str, Block] = {
    "shgo": {"theta": 2, "poles": -1},
    "fhgo2": {"theta": 2, "poles": -1},
    "extended": {"theta": 1.5, "poles": -1},
    "ekf": {"Q": Q, "internal": {"P": 1}},
}
MEASURED = [0, 2]
Sample = tuple[float, float, int, float]  # taken, known, the output's number, value
Slope = Callable[[np.ndarray, float], np.ndarray]


def plant(x: np.ndarray, t: float) -> np.ndarray:
    a, b, c, d = x
    return np.array([b, -np.sin(a) + 0.3 * c - 0.1 * b, d, -c - 0.2 * a * b + 0.5 * np.sin(t)])


def slopes_of_plant(x: np.ndarray) -> np.ndarray:
    a, b, _, _ = x
    return np.array([[0, 1, 0, 0], [-np.cos(a), -0.1, 0.3, 0], [0, 0, 0, 1], [-0.2 * b, -0.2 * a, -1, 0]])


def integrated(slope: Slope, z: np.ndarray, start: float, end: float) -> np.ndarray:
    """The classical Runge-Kutta method."""
    count = max(1, int(np.ceil((end - start) / STEP - 1e-9)))
    h = (end - start) / count
    for t in start + h * np.arange(count):
        k1 = slope(z, t)
        k2 = slope(z + h / 2 * k1, t + h / 2)
        k3 = slope(z + h / 2 * k2, t + h / 2)
        k4 = slope(z + h * k3, t + h)
        z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return z


def continuous(kind: str, z: np.ndarray, t: float, e: np.ndarray) -> np.ndarray:
    """Slopes of (xhat, filter or unknown input, alpha), in chains of two states; all poles at -theta."""
    dz = np.zeros(8)
    dz[:4], theta = plant(z[:4], t), OBSERVERS[kind]["theta"]
    for i, first in enumerate(MEASURED):
        own = z[4 + i]
        if kind == "shgo":
            gains, v = (2, 1), e[i]
        elif kind == "fhgo2":
            gains, v = (3, 1), own
            dz[4 + i] = theta * (e[i] - 3 * own)
        else:
            gains, v = (3, 3), e[i]
            dz[4 + i] = -(theta**3) * e[i]
            dz[first + 1] += own
        dz[first] -= theta * gains[0] * v
        dz[first + 1] -= theta**2 * gains[1] * v
        dz[6 + i] = -theta * gains[0] * v
    return dz


def by_innovation(kind: str, samples: Sequence[Sample], times: Sequence[float]) -> np.ndarray:
    z, now, found = np.zeros(8), 0.0, []
    z[:4] = list(START.values())
    then: dict[tuple[float, int], float] = {}
    compared: dict[int, float] = {}
    newest = {0: -1.0, 1: -1.0}

    def slope(z: np.ndarray, t: float) -> np.ndarray:
        return continuous(kind, z, t, np.array([compared[i] + z[6 + i] if i in compared else 0.0 for i in range(2)]))

    for event in sorted(
        {*times, *(taken for taken, *_ in samples), *(known for _, known, *_ in samples if known < END)}
    ):
        if event > now:
            z, now = integrated(slope, z, now, event), event
        for taken, _, i, _ in samples:
            if taken == event:
                then[taken, i] = z[MEASURED[i]] - z[6 + i]
        for taken, known, i, y in sorted(samples):
            if known == event and taken > newest[i]:
                newest[i], compared[i] = taken, then[taken, i] - y
        if event in times:
            found.append(z[:4])
    return np.array(found)


def in_order(kind: str, samples: Sequence[Sample], end: float) -> np.ndarray:
    if kind != "ekf":
        return by_innovation(kind, [(taken, taken, i, y) for taken, _, i, y in samples], [end])[0]

    def slope(z: np.ndarray, t: float) -> np.ndarray:
        F, P = slopes_of_plant(z[:4]), z[4:].reshape(4, 4)
        return np.append(plant(z[:4], t), F @ P + P @ F.T + np.diag([0, Q["b"], 0, Q["d"]]))

    z, now = np.append(list(START.values()), np.eye(4)), 0.0
    for event in sorted({taken for taken, *_ in samples}):
        z, now = integrated(slope, z, now, event), event
        of_now = [one for one in samples if one[0] == event]
        x, P, C = z[:4], z[4:].reshape(4, 4), np.eye(4)[[MEASURED[i] for _, _, i, _ in of_now]]
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + 0.0025 * np.eye(len(of_now)))
        z = np.append(x + K @ (np.array([y for *_, y in of_now]) - C @ x), P - K @ C @ P)
    return integrated(slope, z, now, end)[:4]


def log(seed: int) -> list[Sample]:
    """Irregular samples of noise: late, in any order, some known together, the last one never; some taken together."""
    rng, found = np.random.default_rng(seed), []
    for i, (gap, longest) in enumerate([(0.15, 0.5), (0.5, 1.2)]):
        taken = np.round(np.cumsum(gap * rng.uniform(0.2, 2, int(END / gap))), 4)
        taken = taken[taken < END]
        known = np.round(taken + longest * rng.uniform(0, 1, taken.size) * (rng.random(taken.size) < 0.6), 4)
        if i:
            known[1:4], known[-1] = max(known[1:4]), END + 2
        found += [
            (t, k, i, y) for t, k, y in zip(taken.tolist(), known.tolist(), rng.normal(size=taken.size), strict=True)
        ]
    moved, (_, known, _, y) = found[0][0], found[-3]
    return [*found[:-3], (moved, max(moved, known), 1, y), *found[-2:]]


@pytest.mark.costly
@pytest.mark.parametrize("late", ["innovation", "replay"])
def test_estimates_are_those_of_plain_integrations(late: str) -> None:
    samples, times = sorted(log(3)), [1.0, 2.0, 3.0, 4.0]
    for i in range(2):
        order = [taken for _, taken in sorted((known, taken) for taken, known, j, _ in samples if j == i)]
        assert order != sorted(order)
    kinds = [kind for kind in OBSERVERS if late == "replay" or kind != "ekf"]
    config: Block = {
        "plant": PLANT,
        "time": {"start": 0, "end": END, "output_step": 1.0},
        "solver": {"method": "rk4", "step": STEP},
        "observers": {kind: {"type": kind, "initial": START, "late": late, **OBSERVERS[kind]} for kind in kinds},
        "data": {
            "file": "log.csv",
            "time": "t",
            "outputs": {"a": {"column": "a", "std": 0.05}, "c": {"column": "c", "std": 0.05}},
        },
    }
    signals = []
    for i, name in enumerate("ac"):
        taken, known, _, y = zip(*(one for one in samples if one[2] == i), strict=True)
        signals.append(signal(name, taken, y, known, std=0.05))
    result = estimate(source(config), recording(*signals), sensitivity=False)
    for kind in kinds:
        if late == "innovation":
            wanted = by_innovation(kind, samples, times)
        else:
            wanted = np.array([in_order(kind, [one for one in samples if one[1] <= t], t) for t in times])
        np.testing.assert_allclose(result.observers[kind].xhat[1:], wanted, rtol=0, atol=1e-8)
