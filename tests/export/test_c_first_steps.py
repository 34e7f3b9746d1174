"""Exported C of a filter that its first steps would lose: they are shorter, as those of the file are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import Block
from exported_c import load_all

from hgorun.config.reading import read_source
from hgorun.estimate import prepared
from hgorun.estimate.carrying import carry_out, one_pass
from hgorun.estimate.completed import completed
from hgorun.estimate.log import log_of
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.steps import first_steps
from hgorun.export.c_files import c_files
from hgorun.export.prepared import exported_estimate

STEP, END = 2.0**-8, 1.0
PLANT: Block = {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-sin(a) - 0.1*b"}, "output": "a"}
KALMAN: Block = {"type": "kalman_bucy", "Q": {"b": 0.3}, "R": {"a": 1e-4}, "internal": {"P": 100.0}}
TAKEN = np.sort(np.append(STEP * np.array([0.0, 0.004, 0.3, 1.7]), np.arange(0.05, END, 0.1)))


def prepared_of(folder: Path, block: Block) -> PreparedEstimate:
    y = np.cos(TAKEN) + 0.01 * np.random.default_rng(3).normal(size=TAKEN.size)
    rows = [f"{t!r},{value!r}" for t, value in zip(TAKEN.tolist(), y.tolist(), strict=True)]
    (folder / "log.csv").write_text("\n".join(["t,y", *rows, ""]))
    data = {"file": "log.csv", "time": "t", "outputs": {"a": {"column": "y", "std": 1e-4}}}
    blocks = {"plant": PLANT, "observers": {"O": {"initial": {"a": 0.8, "b": 0.0}, **block}}, "data": data}
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump(blocks))
    text, source = read_source(config, ())
    recording = log_of(source, config).read()
    return prepare_estimate(completed(source, recording, "config", text), recording)


def test_the_numbers_are_those_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepared, "nominal_step", lambda one: STEP)
    ready = prepared_of(tmp_path, KALMAN)
    events = np.append(0.0, ready.samples[0].taken[1:])
    rows = one_pass(ready, events, STEP)[0].rows[:, :, 0]
    theirs = ready.run.structure.estimates_along(events, ready.run.numbers.p, rows, None).of(0)
    exported = exported_estimate(ready)
    (observer,) = load_all(tmp_path, exported).values()
    count = first_steps.early(ready.experiment, STEP).times.size
    assert f" HGO_O_MAX_STEPS of them, and the first {count}, which are shorter." in c_files(exported[0])["O.h"]
    own = []
    for t, y in zip(events.tolist(), ready.samples[0].values.tolist(), strict=True):
        assert observer.predict(t) == 0
        own.append(observer.estimate)
        assert observer.update(t, [y], 1) == 0
    expected = np.asarray(theirs)[1:]
    np.testing.assert_allclose(own[1:], expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


@pytest.mark.costly
def test_the_first_steps_are_beside_those_that_a_prediction_may_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the header says: a prediction of one step takes all of them, too."""
    monkeypatch.setattr(prepared, "nominal_step", lambda one: STEP)
    exported = exported_estimate(prepared_of(tmp_path, KALMAN))
    (observer,) = load_all(tmp_path, exported, "-O0", "-DHGO_O_MAX_STEPS=1").values()
    assert exported[0].early.times.size > 1
    assert observer.predict(exported[0].step) == 0
    assert observer.predict(3 * exported[0].step) != 0


def test_no_step_of_it_is_made_again(tmp_path: Path) -> None:
    """The code takes a step with which nothing is lost, where the file takes a longer one and makes a flow again."""
    ready = prepared_of(tmp_path, {"type": "ukf", "Q": {"b": 0.001}})
    found = carry_out(ready, np.array([0.0, ready.run.span]))
    assert found.step == ready.run.step
    (exported,) = exported_estimate(ready)
    assert exported.step < found.step
    assert exported.verdict().status == "ok"
    assert not exported.early.times.size
