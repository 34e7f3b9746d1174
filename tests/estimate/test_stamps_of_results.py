"""The times of samples in a result are those of the log, bit for bit, though a run counts from its own start."""

from __future__ import annotations

import numpy as np
import pytest
from recordings import PENDULUM, START, recorded_of, recording, signal, source

from hgorun.data.recording import Signal
from hgorun.estimate.estimate import estimate

RNG = np.random.default_rng(6)
TAKEN = np.round(0.35 + 0.1 * np.arange(60) + RNG.uniform(0, 0.05, 60), 6)
KNOWN = np.round(TAKEN + 0.3 * (np.arange(60) % 4 == 2), 6)


def shortened(start: float, end: float) -> np.ndarray:
    """Whether each sample was taken and known in a run."""
    return np.asarray((start <= TAKEN) & (end >= KNOWN))


@pytest.mark.parametrize(("start", "end"), [(-7.3, 7.0), (float(TAKEN[3]), float(KNOWN[50]))])
def test_they_are_not_rounded_there_and_back(start: float, end: float) -> None:
    aside: Signal = signal("a", TAKEN + 0.01, np.sin(TAKEN))
    config = {
        "time": {"start": start, "end": end, "output_step": 0.1},
        "plant": PENDULUM,
        "observers": {"O": {"type": "shgo", "theta": 2, "poles": -1, "initial": START}},
        "solver": {"step": 0.02},
    }
    log = recording(signal("a", TAKEN, np.sin(TAKEN), KNOWN), reference={"b": aside})
    found = recorded_of(estimate(source(config), log, held_out={"a": aside}, sensitivity=False))
    which = shortened(start, end)
    order = np.lexsort((TAKEN[which], KNOWN[which]))
    one = found.outputs["a"]
    assert one.taken.tolist() == TAKEN[which][order].tolist()
    assert one.available.tolist() == KNOWN[which][order].tolist()
    assert one.y.tolist() == np.sin(TAKEN)[which][order].tolist()
    inside = aside.taken[(aside.taken >= start) & (aside.taken <= end)]
    assert found.held_out["a"].taken.tolist() == found.reference["b"].taken.tolist() == inside.tolist()
    assert np.any(start + (TAKEN - start) != TAKEN)  # as it would be
