"""What is held out is not used, a reference is only compared, and streams of late samples are refused at the start."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.estimate.scores.shut_out import shut_out
from hgorun.result.reading import read

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: -sin(a) - 0.1*b}
  output: a
  units: {a: rad, b: rad/s}
solver: {step: 0.02}
data:
  file: [first.csv, second.csv]
  time: t
  outputs: {a: {column: angle, std: 0.02}}
observers:
  o: {type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}
"""
QUIET = ("--no-plots", "--no-sensitivity")
T = np.round(0.1 * np.arange(60), 10)
Y = np.round(np.sin(T) + 0.02 * np.cos(7.0 * np.arange(60) ** 1.5), 4)


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    rows = [f"{t},{y},{1000 * y}" for t, y in zip(T, Y, strict=True)]
    for name, some in (("first.csv", rows[:40]), ("second.csv", rows[40:])):
        (tmp_path / name).write_text("t,angle,millirad\n" + "\n".join(some) + "\n")
    (tmp_path / "pendulum.yaml").write_text(CONFIG)
    return Shell(tmp_path, monkeypatch, capsys)


def scores_of(shell: Shell, *words: str) -> dict[str, dict[str, float]]:
    code, out, err = shell("estimate", "pendulum.yaml", *words, *QUIET, "--json")
    assert code == 0, err
    found: dict[str, dict[str, float]] = json.loads(out)["observers"]["o"]["scores"]
    return found


def test_a_part_of_the_log_that_is_held_out_is_given_to_no_observer(shell: Shell) -> None:
    """The same as where the part is a reference, and no part of the log."""
    held = scores_of(shell, "--holdout", "a=second.csv", "--set", "time.end=5.9")
    xhat = read(shell.folder / "results" / "pendulum.h5").observers["o"].xhat
    beside = "data.reference.a={column: angle, file: second.csv}"
    compared = scores_of(shell, "--set", "data.file=first.csv", "--set", beside, "--set", "time.end=5.9")
    assert np.array_equal(read(shell.folder / "results" / "pendulum.h5").observers["o"].xhat, xhat)
    assert held["holdout_rmse"] == compared["reference_rmse"]
    assert held["innovation_rms"] == compared["innovation_rms"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("first.csv", "--holdout", "a=first.csv"), "all samples of the output a stand there"),
        (("--holdout", "a=./first.csv", "--set", "data.outputs.a.file=first.csv"), "observers would get none"),
        (
            ("--holdout", "x=first.csv", "--set", "data.reference={x: angle}"),
            "observers get this column angle as the output a: hold out some of its samples, --holdout a=5",
        ),
        (
            ("--set", "data.reference={a: {column: angle, gate: 4}}"),
            "data.reference.a: gate is of samples that observers get, and none gets a reference: leave it out",
        ),
        (("--set", "data.reference={b: {column: angle, available: t}}"), "data.reference.b: available is of samples"),
        (("--set", "data.reference={b: {column: angle, std: 1}}"), "data.reference.b: std is of samples"),
    ],
)
def test_what_would_be_compared_with_itself_or_ignored_is_refused(
    shell: Shell, words: tuple[str, ...], message: str
) -> None:
    code, out, err = shell("estimate", "pendulum.yaml", *words, *QUIET)
    assert (code, out) == (2, "")
    assert message in err
    assert not (shell.folder / "results").exists()


def test_a_gate_that_leaves_out_too_many_is_not_as_it_should_be(shell: Shell) -> None:
    """Which stderr says, and the exit code with --strict."""
    sure = "observers={K: {type: ekf, Q: {b: 1e-9}, R: 1e-9, initial: {a: 0, b: 3}}}"
    words = ("estimate", "pendulum.yaml", "--set", sure, *QUIET)
    for gate, strict, expected in ((None, True, 0), (3, False, 0), (3, True, 3)):
        code, _, err = shell(
            *words, *(["--set", f"data.outputs.a.gate={gate}"] if gate else []), *(["--strict"] if strict else [])
        )
        assert code == expected, err
        assert ("K: the gate of a left out" in err) == (gate is not None)
    assert not list(shut_out(replace(read(shell.folder / "results" / "pendulum.h5"), recorded=None)))


@pytest.mark.parametrize("key", ["outputs", "reference"])
def test_units_limits_and_quality_of_a_reference_are_those_of_an_output(shell: Shell, key: str) -> None:
    """Of a column in thousandths of the unit: converted, and left out where it is implausible or marked."""
    config = shell.folder / "pendulum.yaml"
    config.write_text(CONFIG.replace("first.csv, second.csv", "log.csv").replace("{column: angle, std: 0.02}", "angle"))
    rows = [f"{t},{y},{1000 * y},{int(k % 9 == 4)}" for k, (t, y) in enumerate(zip(T, Y, strict=True))]
    (shell.folder / "log.csv").write_text("t,angle,millirad,bad\n" + "\n".join(rows) + "\n")
    block = "{column: millirad, unit: mrad, plausible: [-0.9, 0.9], quality: {column: bad, good: [0]}}"
    code, _, err = shell("estimate", "pendulum.yaml", "--set", f"data.{key}.a={block}", *QUIET)
    assert code == 0, err
    kept = (abs(Y) <= 0.9) & (np.arange(T.size) % 9 != 4)
    recorded = read(shell.folder / "results" / "pendulum.h5").recorded
    assert recorded is not None
    found = recorded.outputs["a"] if key == "outputs" else recorded.reference["a"]
    np.testing.assert_allclose(found.taken, T[kept], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.y, Y[kept], rtol=1e-12)
    assert f"{key}.a" in err


@pytest.mark.parametrize("stated", [(), ("--set", "data.outputs.a.unit=deg")])
def test_the_unit_of_a_file_that_is_held_out_is_stated_for_it_alone(shell: Shell, stated: tuple[str, ...]) -> None:
    """What a key of the output converts is the log."""
    rows = [f"{t},{1000 * y}" for t, y in zip(T + 0.05, Y, strict=True)]
    (shell.folder / "lab.csv").write_text("t,angle\ns,mrad\n" + "\n".join(rows[:-1]) + "\n")
    words = ("estimate", "pendulum.yaml", "--holdout", "a=lab.csv", *QUIET)
    code, out, err = shell(*words, *stated)
    assert (code, out) == (2, "")
    advised = 'data.reference: {a: {file: "lab.csv", column: "angle", unit: mrad}}'
    assert f"the file says mrad in {shell.folder / 'lab.csv'}" in err
    assert f"{advised} converts" in err
    held = scores_of(shell, *words[2:4], "--set", advised.replace(": ", "=", 1))
    assert held["holdout_rmse"] == held["reference_rmse"]
    assert held["holdout_rmse"]["a"] < 0.1
    (shell.folder / "lab.csv").write_text("t,angle\ns,Skt\n" + "\n".join(rows[:-1]) + "\n")
    code, _, err = shell(*words)
    assert (code, "the file says Skt, which is not a known unit, the model has rad: taken as they are" in err) == (
        0,
        True,
    )


TWO = (
    "observers={S: {type: shgo, theta: 2, poles: -1, initial: {a: 0}}, "
    "E: {type: ekf, Q: {b: 0.1}, R: 0.01, initial: {a: 0}}}"
)
MESSAGE = (
    "in a stream all observers treat late samples alike, and these do not (S: innovation, E: replay): "
    "give observers.S.late: replay"
)
CSV = "t,signal,y\n0.1,a,0.1\n0.2,a,0.2\n"
LATE = "t,signal,y,available\n0.1,a,0.1,0.1\n0.2,a,0.2,0.2\n"
JSON = '{"t": 0.1, "signal": "a", "y": 0.1}\n{"t": 0.2, "signal": "a", "y": 0.2}\n'
SAID = "data.outputs.a={column: angle, available: t}"
AGREED = "observers.S.late=replay"


@pytest.mark.parametrize(
    ("text", "more", "code", "told"),
    [
        (CSV, (), 0, ""),  # none can be late
        (CSV, (SAID,), 0, ""),
        (LATE, (), 2, MESSAGE),
        (LATE, (AGREED,), 0, ""),
        (JSON, (SAID,), 2, MESSAGE),
        (JSON, (SAID, AGREED), 0, ""),
        (JSON, (), 0, f"late samples will be refused: {MESSAGE}"),  # any of them may be late
        (JSON + '{"t": 0.1, "signal": "a", "y": 1, "available": 0.3}\n', (), 2, f"taken at 0.1 is late, and {MESSAGE}"),
    ],
)
def test_observers_that_treat_late_samples_differently_are_refused_before_the_first(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, text: str, more: tuple[str, ...], code: int, told: str
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    changes = (word for change in (TWO, *more) for word in ("--set", change))
    found, out, err = shell("estimate", "pendulum.yaml", "-", *changes)
    assert found == code
    assert told in err
    assert bool(err) == bool(told)
    assert bool(out) == (code == 0 or (text.startswith("{") and not more))  # no line before it is refused


def test_where_none_is_corrected_by_samples_the_remedy_is_the_innovation(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(LATE))
    one = "{type: shgo, theta: 2, poles: -1}"
    words = ("--set", f"observers={{A: {one[:-1]}, late: drop}}, B: {one}}}")
    code, _, err = shell("estimate", "pendulum.yaml", "-", *words)
    assert code == 2
    assert "(A: drop, B: innovation): give observers.A.late: innovation" in err


@pytest.mark.parametrize(("late", "expected"), [("drop", 1), ("innovation", 0)])
def test_a_stream_tells_how_many_samples_were_left_out(
    late: str, expected: int, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(LATE + "0.3,a,0.3,0.4\n0.35,a,0.3,0.5\n0.5,a,0.4,0.5\n"))
    words = f"observers={{A: {{type: shgo, theta: 2, poles: -1, late: {late}}}}}"
    code, _, err = shell("estimate", "pendulum.yaml", "-", "--set", words)
    assert code == 0
    assert err.count("2 samples of a were left out since they were late (late: drop)") == expected


@pytest.mark.parametrize(("older", "expected"), [(False, 3), (True, 1)])
def test_late_samples_are_counted_over_all_starts(
    older: bool, expected: int, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that come again count once. A checkpoint of an older version has no counts, and is read."""
    words = ("--set", "observers={A: {type: shgo, theta: 2, poles: -1, late: drop}}", "--checkpoint", "state")
    rows, state = ("0.3,a,0.3,0.4\n", "0.35,a,0.3,0.5\n", "0.45,a,0.4,0.6\n"), shell.folder / "state"
    for last, count in ((2, 2), (3, expected)):
        monkeypatch.setattr(sys, "stdin", io.StringIO(LATE + "".join(rows[:last])))
        code, _, err = shell("estimate", "pendulum.yaml", "-", *words)
        assert code == 0
        assert f"{count} samples of a were left out since they were late (late: drop)" in err
        head, _, rest = state.read_bytes().partition(b"\n")
        if older:
            magic, told = head[:16], json.loads(head[16:])
            state.write_bytes(magic + json.dumps(told[:3]).encode() + b"\n" + rest)


@pytest.mark.parametrize("column", ["", ",known"])
def test_what_is_held_out_need_not_say_when_it_was_known(column: str, shell: Shell) -> None:
    """Only the times at which it was taken matter; rows may stand in the order of their arrival."""
    for name, head in (("given.csv", ",known"), ("held.csv", column)):
        some = range(1, 60, 2) if name == "held.csv" else range(0, 60, 2)
        rows = [f"{T[k]},{Y[k]}" + (f",{T[k] + 0.5:.1f}" if head else "") for k in some]
        rows[3], rows[4] = rows[4], rows[3]
        (shell.folder / name).write_text("\n".join([f"t,angle{head}", *rows]) + "\n")
    given = ("--set", "data.file=given.csv", "--set", "data.outputs.a.available=known", "--set", "time.end=6.4")
    held = scores_of(shell, *given, "--holdout", "a=held.csv")["holdout_rmse"]["a"]
    reference = "data.reference.a={column: angle, file: held.csv, faults: {backwards: sort}}"
    assert held == scores_of(shell, *given, "--set", reference)["reference_rmse"]["a"]


def test_where_a_hold_out_leaves_samples_of_one_time_it_is_said(shell: Shell) -> None:
    """The log has samples of two: that these are of one time is no fault of it. A run that goes on is made."""
    (shell.folder / "two.csv").write_text("t,angle\n1,0.3\n1.1,0.35\n")
    words = ("estimate", "pendulum.yaml", "two.csv", "--holdout", "a=2", *QUIET)
    told = "two.csv: a: all samples but those at 1 are held out, of a log from 1 to 1.1"
    code, _, err = shell(*words)
    assert code == 2
    assert told in err
    assert err.index(told) < err.index("all samples are of one time, 1")
    code, _, err = shell(*words, "--set", "time.end=1.5")
    assert (code, told in err) == (0, True)
    code, _, err = shell("estimate", "pendulum.yaml", "two.csv", *QUIET)
    assert (code, err) == (0, "")


def test_where_period_leaves_samples_of_one_time_tune_says_it(shell: Shell) -> None:
    (shell.folder / "two.csv").write_text("t,angle\n1,0.3\n1.1,0.35\n1.2,0.4\n")
    tune = "tune={gains: {observers.o.theta: {log: [1, 4]}}, minimise: 'holdout_rmse(o, a)'}"
    code, _, err = shell("tune", "pendulum.yaml", "two.csv", "--set", tune, "--set", "data.period=10")
    assert code == 2
    assert "all samples that data.period holds out lie in one gap of the a that observers get" in err
