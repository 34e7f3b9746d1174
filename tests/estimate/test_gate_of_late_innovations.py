"""What a gate judges of a late sample that enters the innovation, against an observer of a few lines."""

from __future__ import annotations

import numpy as np
import pytest
from recordings import PENDULUM, START, recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate

THETA, GATE, STD, STEP = 2.0, 4.0, 0.02, 0.02
RNG = np.random.default_rng(3)
TAKEN = 0.1 * np.arange(1, 101)
ARRIVAL = np.arange(1, 101) * 5 + 5 * RNG.integers(0, 16, 100)  # in steps: up to 1.5 s late
VALUES = 0.8 * np.sin(1.1 * TAKEN) + STD * RNG.standard_normal(100)
VALUES[::6] += 0.3 * RNG.standard_normal(17)


def slope(w: np.ndarray, held: float | None) -> np.ndarray:
    """Of the estimate and of alpha, with poles of -1: the innovation is what is held, and alpha."""
    e = 0.0 if held is None else held + w[2]
    return np.array([w[1] - 2 * THETA * e, -np.sin(w[0]) - 0.1 * w[1] - THETA**2 * e, -2 * THETA * e])


def flown(w: np.ndarray, held: float | None) -> np.ndarray:
    """A step; nothing corrects before a sample is known."""
    a = slope(w, held)
    b = slope(w + STEP / 2 * a, held)
    c = slope(w + STEP / 2 * b, held)
    return np.asarray(w + STEP / 6 * (a + 2 * b + 2 * c + slope(w + STEP * c, held)))


def outlier(size: float, before: list[float]) -> bool:
    """The rule of the page."""
    if len(before) < 2:
        return False
    median = 1.4826 * max(8 / len(before), 1) * float(np.median(before[-61:]))
    return size > GATE * max(median, STD)


def followed(*, stored: bool) -> tuple[np.ndarray, np.ndarray]:
    """Which samples are used, in the order of arrival, and the estimate at the end.

    ``stored``: whether what is judged is the innovation of when a sample was taken.
    """
    order = np.lexsort((TAKEN, ARRIVAL)).tolist()
    w, newest = np.array([0.0, 1.0, 0.0]), -1
    held: float | None = None
    sizes: list[float] = []
    used: list[bool] = []
    kept: dict[int, np.ndarray] = {}
    for k in range(701):
        if k % 5 == 0:
            kept[k] = w
        for i in [i for i in order if ARRIVAL[i] == k]:
            before = kept[5 * i + 5]
            e = before[0] - VALUES[i]
            judged = abs(e if stored else e + w[2] - before[2])
            used.append(i > newest and not outlier(judged, sizes))
            sizes += [judged] if i > newest else []
            if used[-1]:
                held, newest = e - before[2], i
        w = flown(w, held) if k < 700 else w
    return np.array(used), w[:2]


@pytest.mark.costly
def test_it_is_the_innovation_that_would_correct_and_not_the_stored_one() -> None:
    config = {
        "time": {"start": 0.0, "end": 14.0, "output_step": 0.1},
        "plant": PENDULUM,
        "observers": {"O": {"type": "shgo", "theta": THETA, "poles": -1, "initial": START}},
        "solver": {"step": STEP},
    }
    log = recording(signal("a", TAKEN, VALUES, STEP * ARRIVAL, gate=GATE, std=STD))
    result = estimate(source(config), log, sensitivity=False)
    used, last = followed(stored=False)
    assert recorded_of(result).outputs["a"].used[:, 0].tolist() == used.tolist()
    np.testing.assert_allclose(result.observers["O"].xhat[-1], last, rtol=1e-9, atol=1e-11)
    assert not np.array_equal(followed(stored=True)[0], used)
