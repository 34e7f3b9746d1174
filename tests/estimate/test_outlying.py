"""Outliers among samples that no observer gets do not decide which gains are best."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.estimate.gains.cases import score
from hgorun.estimate.scores.outlying import Errors, few, outliers, told

SMALL = np.tile([0.1, -0.1], 10)  # the median of their sizes is that of normal numbers with this deviation:
DEVIATION = 0.1 * 1.4826


def errors(changes: dict[int, float], size: float = 1, gate: float | None = 4.0, noise: float = 0) -> Errors:
    values = size * SMALL
    for k, value in changes.items():
        values[k] = value
    return Errors("y", 5 + np.arange(20.0), values, noise, gate, 1)


@pytest.mark.parametrize(
    ("runs", "found"),
    [
        ([errors({7: 4.01 * DEVIATION})], [7]),
        ([errors({7: -4.01 * DEVIATION})], [7]),
        ([errors({7: 3.99 * DEVIATION})], []),
        ([errors({7: 4.01 * DEVIATION}, noise=0.2)], []),
        ([errors({7: 0.81}, noise=0.2)], [7]),
        ([errors({7: 3.0}, gate=None)], []),
        ([errors({7: 3.0, 12: 3.0})], [7, 12]),
        ([errors({7: 3.0, 12: 3.0, 14: 3.0})], []),  # too many
        ([errors({0: 3.0, 1: 3.0})], []),  # on the way
        ([errors({7: 3.0}), errors({7: 0.1}, size=1.9)], []),  # with other gains that are as good it is none
        ([errors({7: 3.0}), errors({7: 0.1}, size=2.1)], [7]),
        ([errors({7: 3.0, 9: 3.0}), errors({7: 3.0})], [7]),
        ([errors({7: 3.0}, size=0)], []),  # exact without it: nothing tells how far errors usually are
    ],
)
def test_a_sample_beyond_the_gate_with_all_good_gains_is_an_outlier(runs: list[Errors], found: list[int]) -> None:
    (out,) = outliers([[run] for run in runs])
    assert np.flatnonzero(out).tolist() == found


def test_few_samples_tell_nothing() -> None:
    assert not few(np.arange(7) == 3).any()
    assert few(np.arange(8) == 3).any()


def test_the_score_is_that_of_the_other_samples() -> None:
    run = [errors({7: 3.0})]
    assert score(run) == pytest.approx(math.sqrt((9 + 19 * 0.01) / 20))
    assert score(run, outliers([run])) == pytest.approx(0.1)
    assert score(None) == math.inf


@pytest.mark.parametrize(
    ("changes", "gate", "says"),
    [
        ({7: 3.0}, 4.0, "y: 1 sample for the search, at t = 12, is beyond the gate with all good gains: the score"),
        ({7: 3.0, 9: 3.0}, 4.0, "y: 2 samples for the search, the first at t = 12, are beyond the gate with"),
        (
            {7: 3.0},
            None,
            "y: 1 sample for the search, at t = 12, is far off and decides the score: an outlier, or one was used "
            "shortly before; without it it is 0.1 in place of 0.678; plausible of the column leaves outliers out",
        ),
        (
            {7: 3.0, 9: 3.0},
            None,
            "2 samples for the search, the first at t = 12, are far off and decide the score: outliers, or some",
        ),
        ({7: 9.0 * DEVIATION}, None, ""),
        ({0: 3.0}, None, ""),
        (
            {0: 3.0},
            4.0,
            "y: 1 sample for the search, at t = 5, is beyond the gate and counted nevertheless, since estimates may "
            "be on their way there: without it the score is 0.1 in place of 0.678; plausible",
        ),
        ({0: 2.0, 1: 3.0}, 4.0, "y: 2 samples for the search, the first at t = 5, are beyond the gate and counted"),
        ({0: 3.0, 1: 3.0, 2: 3.0}, 4.0, ""),  # too many for outliers
        ({0: 4.01 * DEVIATION}, 4.0, ""),  # which hardly counts
        ({}, 4.0, ""),
    ],
)
def test_outliers_are_told(changes: dict[int, float], gate: float | None, says: str) -> None:
    run = [errors(changes, gate=gate)]
    found = list(told(run, outliers([run]), "search"))
    assert len(found) == (says != "")
    assert says in "".join(found)


CONFIG = """
plant: {states: [a, b], dynamics: {a: b, b: -4*a}, output: a}
solver: {step: 0.02}
data: {file: log.csv, time: t, period: 0.2, outputs: {a: {column: a, std: 0.01, gate: 6}}}
observers: {o: {type: shgo, theta: 2, poles: -1, initial: {b: 0}}}
tune: {gains: {observers.*.theta: {log: [0.3, 8]}}, minimise: "holdout_rmse(*, a)", budget: 20, seeds: 1}
"""


def tuned(shell: Shell, rows: list[str], *more: str) -> tuple[dict[str, object], str]:
    (shell.folder / "log.csv").write_text("\n".join(["t,a", *rows]) + "\n")
    (shell.folder / "one.yaml").write_text(CONFIG)
    code, out, err = shell("tune", "one.yaml", "--json", *more)
    assert code == 0
    return json.loads(out)["observers"]["o"], err


@pytest.mark.measured
@pytest.mark.slow
def test_gains_are_those_of_the_log_without_the_outlier(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the samples between those that the observer gets, a gap decides the search and the next one the report."""
    shell = Shell(tmp_path, monkeypatch, capsys)
    t = 0.05 * np.arange(121)
    values = np.cos(2 * t) + 0.01 * np.random.default_rng(4).normal(size=t.size)
    rows = [f"{time:.2f},{a:.6f}" for time, a in zip(t, values, strict=True)]
    for k, whose in ((54, "search"), (50, "report")):
        outlying, without = [*rows], [*rows]
        outlying[k] = f"{t[k]:.2f},{values[k] + 5:.6f}"
        del without[k]
        found, err = tuned(shell, outlying)
        assert f"one: o: a: 1 sample for the {whose}, at t = {t[k]:g}, is beyond the gate" in err
        wanted, quiet = tuned(shell, without)
        assert found == wanted
        assert "sample for" not in quiet
    assert (
        "sample for the report, at t = 2.5, is far off"
        in tuned(shell, outlying, "--set", "data.outputs.a.gate=null")[1]
    )
