"""A gate leaves out the outlier, and not what the other outputs say at the same time."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, inline
from recordings import recorded_of, recording, signal, source

from hgorun.data.recording import Recording
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

PLANT = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"ya": "a", "yb": "b"})
NOISE: Block = {"sampling": {"period": 0.2}, "noise": [{"type": "gaussian", "std": 0.05}]}
TAKEN = 0.2 * np.arange(1, 16)
OUTLIER = 7
A, B = 0.6 * np.cos(TAKEN), -0.6 * np.sin(TAKEN)
B[OUTLIER] += 3.0
KEPT = np.arange(TAKEN.size) != OUTLIER
GATES = {"ya": 5.0, "yb": 5.0}


def config(block: Block) -> Block:
    return {
        "time": {"start": 0.0, "end": 3.0, "output_step": 0.1},
        "plant": PLANT,
        "observers": {"O": {"Q": {"b": 0.1}, "initial": {"a": 0.5}, **block}},
        "measurement": NOISE,
        "solver": {"step": 0.01},
    }


def both(kept: np.ndarray, late: np.ndarray) -> Recording:
    a = signal("ya", TAKEN, A, TAKEN + late, gate=5.0)
    return recording(a, signal("yb", TAKEN[kept], B[kept], (TAKEN + late)[kept], gate=5.0))


def found(block: Block, kept: np.ndarray, late: float = 0.0) -> Result:
    delays = np.where(np.arange(TAKEN.size) % 3 == 1, late, 0.0)
    return estimate(source(config(block)), both(kept, delays), sensitivity=False)


@pytest.mark.costly
@pytest.mark.parametrize("kind", ["ekf", "ukf"])
@pytest.mark.parametrize("late", [0.0, 0.5])
def test_the_estimate_is_that_of_the_log_without_the_outlier(kind: str, late: float) -> None:
    whole, without = found({"type": kind}, KEPT | True, late), found({"type": kind}, KEPT, late)
    one = recorded_of(whole).outputs
    assert one["yb"].taken[~one["yb"].used[:, 0]].tolist() == [TAKEN[OUTLIER]]
    assert one["ya"].used.all()
    assert np.allclose(whole.observers["O"].xhat, without.observers["O"].xhat, rtol=1e-12, atol=1e-14)


def test_so_is_that_of_a_stream() -> None:
    gated, plain = (Estimator(Experiment(config({"type": "ekf"})), gates=gates) for gates in (GATES, {}))
    for k, (t, a, b) in enumerate(zip(TAKEN, A, B, strict=True)):
        gated.update(t, {"ya": a, "yb": b})
        plain.update(t, {"ya": a, "yb": b} if k != OUTLIER else {"ya": a})
    assert gated.gated["O"] == {"ya": (0, TAKEN.size), "yb": (1, TAKEN.size)}
    assert np.allclose(gated.estimate()["O"], plain.estimate()["O"], rtol=1e-12, atol=1e-14)
