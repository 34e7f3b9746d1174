"""Samples that are held out or compared, and stand in the log under another file name as well."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.result.reading import read

CONFIG = """
plant: {states: [a, b], dynamics: {a: b, b: -a}, output: a, units: {a: rad, b: rad/s}}
solver: {step: 0.02}
data: {file: log.csv, time: t, outputs: {a: {column: angle, std: 0.05}}}
observers: {o: {type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}}
time: {start: 0, end: 5.9}
"""
TUNE = "tune={gains: {observers.o.theta: {log: [1, 4]}}, minimise: 'reference_rmse(o, a)', budget: 20}"
QUIET = ("--no-plots", "--no-sensitivity", "--json")
T = np.round(0.1 * np.arange(60), 10)
Y = np.round(np.sin(T) + 0.05 * np.cos(7.0 * np.arange(60) ** 1.5), 4)
HELD = range(40, 50)
NAMED = "10 samples of this output have the time and the value of one that is held out: not given to observers either"
OTHERWISE = "have the time of one in the log, but not its value: observers get the one in the log"


def write(path: Path, rows: range | list[int], *, y: np.ndarray = Y, head: str = "t,angle", unit: float = 1.0) -> None:
    path.write_text("\n".join([head, *(f"{T[k]},{unit * y[k]:.10g}" for k in rows)]) + "\n")


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "pendulum.yaml").write_text(CONFIG)
    write(tmp_path / "log.csv", range(60))
    write(tmp_path / "rest.csv", [k for k in range(60) if k not in HELD])
    write(tmp_path / "part.csv", HELD)
    return Shell(tmp_path, monkeypatch, capsys)


def scores(shell: Shell, *words: str) -> tuple[dict[str, dict[str, float]], str]:
    code, out, err = shell("estimate", "pendulum.yaml", *words, *QUIET)
    assert code == 0, err
    found: dict[str, dict[str, float]] = json.loads(out)["observers"]["o"]["scores"]
    return found, err


def test_samples_that_stand_in_the_log_too_are_not_given(shell: Shell) -> None:
    """The same as of a log without them, also where the file has another unit, and where the log is in parts."""
    expected, err = scores(shell, "rest.csv", "--holdout", "a=part.csv")
    assert not err
    found, err = scores(shell, "--holdout", "a=part.csv")
    assert found == expected
    assert f"log.csv:42: outputs.a: {NAMED}" in err
    write(shell.folder / "part.csv", HELD, head="t,angle\ns,mrad", unit=1000.0)
    unit = (
        "--set",
        "data.outputs.a.unit=rad",
        "--set",
        "data.reference={a: {file: part.csv, column: angle, unit: mrad}}",
    )
    found, err = scores(shell, "--holdout", "a=part.csv", *unit)
    assert found["holdout_rmse"]["a"] == pytest.approx(expected["holdout_rmse"]["a"], rel=1e-9)
    assert NAMED in err


def test_where_a_part_of_the_log_is_held_out_its_copy_in_another_part_is_not_given(shell: Shell) -> None:
    expected, _ = scores(shell, "rest.csv", "--holdout", "a=part.csv")
    found, err = scores(
        shell,
        "log.csv",
        "part.csv",
        "--holdout",
        "a=part.csv",
        "--set",
        "data.faults={repeated: keep, backwards: sort}",
    )
    assert found == expected
    assert f"log.csv:42: outputs.a: {NAMED}" in err


def test_another_value_at_that_time_is_told(shell: Shell) -> None:
    """A second measurement, or one that was rounded: it is given, as before."""
    other = Y.copy()
    other[HELD[:2]] += 0.1
    write(shell.folder / "part.csv", HELD, y=other)
    _, err = scores(shell, "--holdout", "a=part.csv")
    assert f"part.csv:2: a: 2 samples that are held out {OTHERWISE}" in err
    assert "log.csv:44: outputs.a: 8 samples of this output have" in err
    write(shell.folder / "part.csv", [40], y=other)
    assert (
        f"part.csv:2: a: 1 sample that is held out {OTHERWISE.replace('have', 'has')}"
        in scores(shell, "--holdout", "a=part.csv")[1]
    )
    write(shell.folder / "part.csv", [40])
    assert "log.csv:42: outputs.a: 1 sample of this output has the time" in scores(shell, "--holdout", "a=part.csv")[1]


def test_equal_values_of_another_measurement_hold_nothing_out(shell: Shell) -> None:
    """Of two coarse sensors many values agree: to leave out just these would choose samples by their errors."""
    coarse = Y.round(1)
    other = coarse.copy()
    other[HELD[:2]] += 0.1
    write(shell.folder / "log.csv", range(60), y=coarse)
    write(shell.folder / "part.csv", HELD, y=other)
    found, err = scores(shell, "--holdout", "a=part.csv")
    assert "of this output have" not in err
    assert (
        f"2 samples that are held out {OTHERWISE}, also where values are equal, since this is another measurement"
        in err
    )
    plain, _ = scores(shell)
    assert found["innovation_rms"] == plain["innovation_rms"]
    _, err = scores(shell, "--set", "data.reference.a={file: part.csv, column: angle}")
    assert "samples of the reference" not in err


def test_a_copy_of_the_whole_log_leaves_nothing(shell: Shell) -> None:
    write(shell.folder / "copy.csv", range(60))
    code, out, err = shell("estimate", "pendulum.yaml", "--holdout", "a=copy.csv", *QUIET)
    assert (code, out) == (2, "")
    assert "all samples of the output a stand there, if under another name, and observers would get none" in err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--set", "data.reference.a={file: part.csv, column: angle}"), "10 of 10 samples of the reference"),
        (
            ("--holdout", "y=part.csv", "--set", "data.outputs={y: angle}", "--set", "plant.output={y: a}"),
            f"log.csv:42: outputs.y: {NAMED}",
        ),
        (
            (
                *("--holdout", "a=part.csv", "--set", "data.outputs={y: angle}", "--set", "plant.output={y: a}"),
                *("--set", "data.reference.a={file: part.csv, column: angle}"),
            ),
            "10 of 10 samples that are held out as the output y",
        ),
        (("--set", "data.reference.a=angle"), "observers get this column as outputs.a: estimates are compared with"),
    ],
)
def test_a_reference_that_observers_get_is_told(shell: Shell, words: tuple[str, ...], told: str) -> None:
    _, err = scores(shell, *words)
    assert told in err


def test_tune_tells_it_too(shell: Shell) -> None:
    words = ("tune", "pendulum.yaml", "--set", TUNE, "--set", "data.reference.a={file: part.csv, column: angle}")
    code, _, err = shell(*words, "-q")
    assert code == 0, err
    assert "part.csv:2: reference.a: observers get 10 of 10 samples of the reference as the output a" in err


@pytest.mark.parametrize("words", [("--holdout", "a=5"), ("--set", "data.period=0.3")])
def test_a_log_that_stands_in_its_files_twice_gives_the_same_residuals(shell: Shell, words: tuple[str, ...]) -> None:
    """With ``repeated: keep`` each sample has a twin: that of one that is held out is not given, nor compared if it is.

    Of every fifth of 120 rows 24 are held out, from the third on: each of another time.
    """
    write(shell.folder / "twice.csv", [k for k in range(60) for _ in range(2)])
    kept = ("--set", "data.faults.repeated=keep")
    _, err = scores(shell, "twice.csv", *kept, *words)
    found = read(shell.folder / "results" / "pendulum.h5").recorded
    assert found is not None
    given, held = found.outputs["a"].taken, found.held_out["a"].taken
    assert not set(given) & set(held)
    if words[0] == "--holdout":
        assert held.size == 24
        assert given.size == 72
        assert (
            "twice.csv:5: outputs.a: 24 samples of this output have the time and the value of one that is held" in err
        )
    tune = TUNE.replace("reference_rmse", "holdout_rmse")
    code, _, err = shell("tune", "pendulum.yaml", "twice.csv", *kept, "--set", tune, "-q")
    assert code == 0
    assert "of this output have the time and the value of one that is held out" in err


@pytest.mark.parametrize("command", ["estimate", "tune"])
def test_where_each_sample_has_a_twin_that_is_held_out_nothing_is_left(shell: Shell, command: str) -> None:
    write(shell.folder / "twice.csv", [0, 0, 1, 1] if command == "tune" else [0, 0])
    tune = TUNE.replace("reference_rmse", "holdout_rmse")
    more = ("--holdout", "a=2") if command == "estimate" else ("--set", tune)
    code, _, err = shell(command, "pendulum.yaml", "twice.csv", "--set", "data.faults.repeated=keep", *more)
    assert code == 2
    assert ("no sample is left that is not held out" if command == "estimate" else "4 samples are too few") in err
