"""Observers that leave their bound do so at the same step in a file, in a stream and in an Estimator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import Block
from recordings import held_input, recording, signal, source

from hgorun.engine.plan import Floats
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result

GAP, COUNT, RATE = 0.0625, 33, 30.0
T: Floats = np.linspace(0.0, GAP * (COUNT - 1), COUNT)
STEP = GAP / 4
PLANT: Block = {"states": ["x", "v"], "dynamics": {"x": "v", "v": f"{RATE}*v"}, "output": "x"}
# v' = 30 v from 1, next to no correction; and one that follows its samples
OBSERVERS: Block = {
    "FREE": {"type": "shgo", "theta": 1e-6, "poles": -1, "initial": {"x": 0.0, "v": 1.0}},
    "HELD": {"type": "shgo", "theta": 60, "poles": -1, "initial": {"x": 0.0, "v": 0.0}},
}


def values(level: float, after: float) -> Floats:
    """Samples of a size, and later ones that are larger."""
    y = np.full(COUNT, level)
    y[after <= T] = 1000 * level
    y[-4:] = 1e9  # which no one knows before
    return y


def when(level: float, after: float, given: float | None) -> float:
    """The end of the first step beyond the bound, of exp(30 t)."""
    ends = STEP * np.arange(1, 4 * COUNT)
    known = np.where(ends > after, 1000 * level, level)
    bound = np.full(ends.size, given) if given is not None else 1e12 * np.maximum(1.0, known)
    return float(ends[np.flatnonzero(np.exp(RATE * ends) > bound)[0]])


def text_of(given: float | None) -> Block:
    return {
        "plant": PLANT,
        "observers": OBSERVERS,
        "time": {"start": 0.0, "end": GAP * (COUNT - 1), "output_step": GAP},
        "solver": {"step": STEP, **({} if given is None else {"divergence": given})},
    }


def of_file(text: Block, y: Floats) -> Result:
    return estimate(source(text), recording(signal("x", T, y)), sensitivity=False)


def stream_of(text: Block, remembered: int = 1000) -> Estimator:
    given = source(text)
    return Estimator(streamed(given, StatedOfData.of(given), "e"), remembered=remembered)


CASES = [(1.0, 9.0, None), (1.0, 0.5, None), (1e-3, 9.0, None), (50.0, 9.0, None), (1.0, 9.0, 1e3), (1.0, 0.5, 1e5)]


@pytest.mark.parametrize(("level", "after", "given"), CASES)
def test_a_file_a_stream_and_an_estimator_lose_it_at_the_same_time(
    level: float, after: float, given: float | None
) -> None:
    text, y, lost = text_of(given), values(level, after), when(level, after, given)
    result, one, several = of_file(text, y), stream_of(text), stream_of(text, remembered=0)
    free = result.observers["FREE"]
    assert (free.status, free.status_at) == ("diverged", lost)
    rows = np.array([_after(one, t, level) for t, level in zip(T.tolist(), y.tolist(), strict=True)])
    for j, label in enumerate(("FREE", "HELD")):
        np.testing.assert_array_equal(rows[:, j], result.observers[label].xhat, err_msg=label)
    np.testing.assert_array_equal(np.isnan(rows[:, 0, 0]), lost <= T)
    several.update(T[0], {"x": y[0]})
    found = several.update_many(T[1:], np.zeros(COUNT - 1, dtype=np.int64), y[1:])
    for j, label in enumerate(("FREE", "HELD")):
        np.testing.assert_array_equal(found[label][0], rows[1:, j])
    np.testing.assert_array_equal(found["FREE"][1], T[1:] >= lost)
    assert one.lost["FREE"]
    assert several.lost["FREE"]


def _after(estimator: Estimator, t: float, y: float) -> list[np.ndarray]:
    estimator.update(t, {"x": y})
    return [x.copy() for x in estimator.estimate().values()]


def test_a_checkpoint_knows_the_samples_from_which_the_bound_follows(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(text_of(None)))
    y, lost = values(1.0, 0.5), when(1.0, 0.5, None)
    assert lost > when(1.0, 9.0, None) + STEP
    first, other = (Estimator.load(tmp_path / "config.yaml") for _ in range(2))
    before = T[when(1.0, 9.0, None) > T].size
    for t, value in zip(T[:before].tolist(), y[:before].tolist(), strict=True):
        first.update(t, {"x": value})
    other.restore(first.checkpoint())
    assert np.isfinite(other.predict(lost - STEP)["FREE"]).all()
    assert np.isnan(other.predict(lost)["FREE"]).all()
    assert not other.lost["FREE"]  # nothing follows from a prediction


def test_the_reason_names_the_bound_at_that_time() -> None:
    trouble = of_file(text_of(None), values(50.0, 9.0)).observers["FREE"].reason
    assert trouble is not None
    assert "the bound is 5e+13 (solver.divergence)" in trouble


def test_a_bound_that_a_start_with_inputs_has_is_that_of_the_file() -> None:
    """Where the start follows from the first value of an input, the bound follows from this start."""
    plant: Block = {
        "states": ["x", "v"],
        "inputs": {"u": 0.0},
        "dynamics": {"x": "v + u", "v": f"{RATE}*v"},
        "output": "x",
    }
    blocks: Block = {"LEVANT": {"type": "levant", "G": 1.0, "initial": {"x": 1.0, "v": 1.0}}}
    text = {**text_of(None), "plant": plant, "observers": blocks}
    given = source(text)
    estimator = Estimator(streamed(given, StatedOfData.of(given), "e"), inputs=("u",))
    estimator.update(0.0, {"x": 0.0}, u={"u": 3e14})
    assert np.isfinite(estimator.predict(GAP)["LEVANT"]).all()
    result = estimate(
        given, recording(signal("x", T[:2], np.zeros(2)), u=held_input("u", [0.0], [3e14])), sensitivity=False
    )
    assert np.isfinite(result.observers["LEVANT"].xhat).all()
