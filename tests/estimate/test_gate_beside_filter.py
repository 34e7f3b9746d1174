"""A gate beside a Kalman filter, against a filter of a few lines that judges each sample before it takes it."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline
from pendulum_filter import corrected, flown
from recordings import recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.gate import gated

PERIOD, STEP, GATE = 0.2, 0.02, 4.0
TAKEN = PERIOD * np.arange(1, 121)
OUT = [3, 4, 5, 20, 57, 58, 90, 119]  # one after the other, after a long time, and the last


def log() -> np.ndarray:
    random = np.random.default_rng(4)
    values = 0.6 * np.cos(0.98 * TAKEN) * np.exp(-0.05 * TAKEN) + 0.1 * random.normal(size=TAKEN.size)
    values[OUT] += random.choice([-3.0, 2.0], len(OUT))
    return np.asarray(values)


def naive(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates after each sample, and which samples were used."""
    z, rows, used = np.array([0.5, 0.0, 1.0, 0.0, 1.0]), [], []
    for y in values:
        z = flown(z, PERIOD, STEP)
        used.append(abs(y - z[0]) <= GATE * np.sqrt(z[2] + 0.01))
        z = corrected(z, y) if used[-1] else z
        rows.append(z[:2])
    return np.array(rows), np.array(used)


@pytest.mark.costly
@pytest.mark.parametrize("most", [1, 3, 512])  # samples that are passed at once
def test_each_sample_is_judged_by_what_the_filter_knew_before_it(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gated, "_AHEAD", min(most, 4))
    monkeypatch.setattr(gated, "_MOST", most)
    values = log()
    block = {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a"),
        "observers": {
            "EKF": {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": {"a": 0.5, "b": 0.0}},
            "SHGO": {"type": "shgo", "theta": 2, "poles": -1, "initial": {"a": 0.5, "b": 0.0}},
        },
        "solver": {"step": STEP},
    }
    result = estimate(source(block), recording(signal("a", TAKEN, values, gate=GATE)), sensitivity=False)
    wanted, used = naive(values)
    assert set(np.flatnonzero(~used)) == set(OUT)
    assert recorded_of(result).outputs["a"].used[:, 0].tolist() == used.tolist()
    np.testing.assert_allclose(result.observers["EKF"].xhat[1:], wanted, rtol=1e-9, atol=1e-11)
