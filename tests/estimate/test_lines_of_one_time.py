"""Samples of one time that come one after the other correct a filter as if they had come together."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import Block, inline
from recordings import recording, signal, source
from shell import Shell

from hgorun.estimate.carrying import estimates, one_pass
from hgorun.estimate.completed import completed
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.stream.estimator import Estimator

# of outputs that are nonlinear one after the other is another filter, not only other rounding
PLANT = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"ya": "a + 0.3*a**2", "yb": "sin(b)"})
TAKEN = np.round(0.1 * np.arange(1, 41), 10)
VALUES = {"ya": 0.6 * np.cos(TAKEN) + 0.1, "yb": -0.5 * np.sin(TAKEN)}
CONFIG: Block = {
    "time": {"start": 0.0, "end": 4.0, "output_step": 0.1},
    "plant": PLANT,
    "observers": {
        "ekf": {"type": "ekf", "Q": {"b": 0.1}, "R": {"ya": 0.02, "yb": 0.01}, "initial": {"a": 0.5, "b": 0.0}}
    },
    "measurement": {"sampling": {"period": 0.1}},
    "solver": {"step": 0.01},
}


@pytest.fixture(name="prepared", scope="module")
def of_the_whole() -> PreparedEstimate:
    """With every third sample of yb missing."""
    b = np.arange(TAKEN.size) % 3 != 0
    log = recording(signal("ya", TAKEN, VALUES["ya"]), signal("yb", TAKEN[b], VALUES["yb"][b]))
    return prepare_estimate(completed(source(CONFIG), log, "x", ""), log)


def rows(order: tuple[str, str]) -> list[tuple[float, str, float]]:
    return [
        (float(t), name, float(VALUES[name][k]))
        for k, t in enumerate(TAKEN)
        for name in order
        if name == "ya" or k % 3 != 0
    ]


def whole(prepared: PreparedEstimate) -> np.ndarray:
    raw, _, _ = one_pass(prepared, TAKEN, prepared.run.step)
    return np.stack(estimates(prepared, TAKEN, raw), axis=1)


@pytest.mark.costly
@pytest.mark.parametrize(("order", "remembered"), [(("ya", "yb"), 0), (("yb", "ya"), 1000)])
def test_updates_one_after_the_other_have_the_bits_of_the_whole(
    prepared: PreparedEstimate, order: tuple[str, str], remembered: int
) -> None:
    """Also if the estimator is begun again from a checkpoint between two of them."""
    estimator, found = Estimator(prepared.experiment, remembered=remembered), {}
    for count, (t, name, y) in enumerate(rows(order)):
        estimator.update(t, {name: y})
        found[t] = np.array(list(estimator.estimate().values()))
        if count % 7 == 2:
            kept, estimator = estimator.checkpoint(), Estimator(prepared.experiment, remembered=remembered)
            estimator.restore(kept)
    assert np.array_equal(np.array([found[t] for t in TAKEN.tolist()]), whole(prepared))


def test_so_have_lines_of_a_stream_that_are_there_together(
    prepared: PreparedEstimate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "pair.yaml").write_text(yaml.safe_dump(CONFIG))
    text = "t,signal,y\n" + "".join(f"{t!r},{name},{y!r}\n" for t, name, y in rows(("ya", "yb")))
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8"))
    code, out, _ = Shell(tmp_path, monkeypatch, capsys)("estimate", "pair.yaml", "-")
    assert code == 0
    last = {float(t): [[float(a), float(b)]] for t, _, a, b, _ in map(_cells, out.splitlines()[1:])}
    assert np.array_equal([last[t] for t in TAKEN.tolist()], whole(prepared))


def _cells(line: str) -> list[str]:
    return line.split(",")
