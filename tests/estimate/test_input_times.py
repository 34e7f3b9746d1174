"""Changes of inputs in logs that do not begin at zero: each acts from its own time on, however differences round."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from recordings import held_input, recording, signal, source

from hgorun.data.recording import Recording
from hgorun.estimate.estimate import estimate
from hgorun.estimate.long import long_log, stretches
from hgorun.estimate.long.long_log import estimate_into
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.file.writing import digests_of
from hgorun.result.hdf5.digests import of_file

SUM = {
    "plant": {"states": ["x"], "dynamics": {"x": "u"}, "output": "x", "inputs": {"u": 0}},
    "data": {"time": "t", "outputs": {"x": {"column": "x", "std": 0.1}}, "inputs": {"u": "u"}},
    "observers": {"O": {"type": "shgo", "theta": 1e-12, "poles": -1, "initial": {"x": 0}}},
    "solver": {"step": 0.01},
}
CONFIG = {key: value for key, value in SUM.items() if key != "data"}
DRAWN = np.random.default_rng(8)
FIRST, COUNT = 55, 100  # in hundredths, as all times are
TAKEN = FIRST + 7 * np.arange(COUNT)
CHANGES = np.concatenate([[FIRST], np.sort(DRAWN.choice(np.arange(FIRST + 1, TAKEN[-1] + 50), 60, replace=False))])
LEVELS = DRAWN.integers(-9, 10, CHANGES.size)


def log(hold: str = "zero") -> Recording:
    return recording(signal("x", TAKEN / 100, 0 * TAKEN), u=held_input("u", CHANGES / 100, LEVELS, hold))


def integral(hold: str, end: int) -> float:
    """Of the input from the first sample on, in fractions."""
    total = Fraction(0)
    for a, b, low, high in zip(CHANGES, CHANGES[1:], LEVELS, LEVELS[1:], strict=False):
        run = min(int(b), end) - int(a)
        if run > 0:
            slope = Fraction(int(high - low), int(b - a)) if hold == "linear" else Fraction(0)
            total += run * int(low) + slope * run**2 / 2
    return float(total / 100)


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_a_change_acts_from_its_own_time_on(hold: str) -> None:
    assert np.any((CHANGES / 100 - 0.55) + 0.55 < CHANGES / 100)  # where rounding loses some of them
    result = estimate(source(CONFIG), log(hold), name="x", text="y")
    found = result.observers["O"].xhat[-1, 0]
    assert found == pytest.approx(integral(hold, int(TAKEN[-1])), abs=1e-9)


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_parts_of_a_long_log_are_what_the_whole_is(hold: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = estimate(source(CONFIG), log(hold), name="x", text="y", sensitivity=False)
    monkeypatch.setattr(long_log, "LONG", 10)
    monkeypatch.setattr(stretches, "_STRETCH", 9)
    path = tmp_path / "a.h5"
    found = estimate_into(source(CONFIG), log(hold), path, name="x", text="y", held_out={}, sensitivity=False)
    assert found is not None
    with h5py.File(path) as file:
        assert of_file(file) == digests_of(whole)


def test_a_stream_gives_what_the_log_gives(tmp_path: Path) -> None:
    config = tmp_path / "c.yaml"
    config.write_text(yaml.safe_dump(SUM | {"time": {"start": FIRST / 100}}))
    estimator = Estimator.load(config)
    changes = dict(zip((CHANGES / 100).tolist(), LEVELS.tolist(), strict=True))
    taken = (TAKEN / 100).tolist()
    for t in sorted({*taken, *changes}):
        if t <= taken[-1]:
            estimator.update(t, {"x": 0.0} if t in taken else {}, u={"u": changes[t]} if t in changes else None)
    result = estimate(source(CONFIG), log(), name="x", text="y", sensitivity=False)
    assert estimator.estimate()["O"][0] == result.observers["O"].xhat[-1, 0]


def test_samples_held_out_behind_the_log_are_told() -> None:
    beside = {"x": signal("x", [500.0, 501.0], [0.2, 0.2])}
    result = estimate(source(CONFIG), log(), name="x", text="y", held_out=beside, sensitivity=False)
    assert "x: no sample held out lies in the run, so that it has no score" in result.remarks


def test_samples_held_out_of_which_some_lie_outside_of_the_run_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = "x: 1 of 3 samples held out lies outside of the run and is not scored"
    beside = {"x": signal("x", [0.65, 0.75, 501.0], [0.2, 0.2, 0.2])}
    result = estimate(source(CONFIG), log(), name="x", text="y", held_out=beside, sensitivity=False)
    assert told in result.remarks
    inside = {"x": signal("x", [0.65, 0.75], [0.2, 0.2])}
    result = estimate(source(CONFIG), log(), name="x", text="y", held_out=inside, sensitivity=False)
    assert not any("held out" in remark for remark in result.remarks)
    monkeypatch.setattr(long_log, "LONG", 10)
    found = estimate_into(
        source(CONFIG), log(), tmp_path / "a.h5", name="x", text="y", held_out=beside, sensitivity=False
    )
    assert found is not None
    assert told in found.remarks
