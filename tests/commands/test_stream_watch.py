"""What stderr tells while a stream runs, and before: why its estimates may be other ones than those of a file."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest
from pendulum_log import CONFIG
from shell import Shell

DRIVEN = CONFIG.replace("b: -sin(a) - 0.1*b", "b: -sin(a) + u").replace("time: t", "time: t\n  inputs: {u: u, v: v}")
DRIVEN = DRIVEN.replace("a: b,", "a: b + v,")


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


def told(shell: Shell, monkeypatch: pytest.MonkeyPatch, config: str, rows: str, *arguments: str) -> list[str]:
    """The lines of stderr."""
    (shell.folder / "c.yaml").write_text(config)
    text = "t,signal,y\n" + "".join(f"{row}\n" for row in rows.split())
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    code, _, err = shell("estimate", "c.yaml", "-", *arguments)
    assert code == 0
    return err.splitlines()


@pytest.mark.parametrize(
    ("rows", "missing"),
    [
        (
            "0,a,0 0.1,a,0 0.2,a,0 0.3,u,1",
            ["hgorun: u, v: no value has come by t = 0.1: until one comes the input counts as 0"],
        ),
        (
            "0,a,0 0,u,1 0.1,a,0 0.2,a,0",
            ["hgorun: v: no value has come by t = 0.1: until one comes the input counts as 0"],
        ),
        ("0,a,0 0,u,1 0,v,1 0.1,a,0 0.2,a,0", []),
        (
            "0,a,0 0,v,1 0.1,a,0 0.2,a,0 0.3,a,0 0.4,a,0 0.5,a,0 0.5,u,0",
            ["hgorun: u: no value has come by t = 0.1: until one comes the input counts as 0"],
        ),
    ],
)
def test_an_input_of_which_no_value_comes_is_told(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, rows: str, missing: list[str]
) -> None:
    assert told(shell, monkeypatch, DRIVEN.replace(", gate: 6", ""), rows) == missing


def test_an_input_without_a_value_has_not_come(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    (line,) = told(shell, monkeypatch, DRIVEN, "0,a,0 0,u, 0,v,1 0.1,a,0 0.2,u, 0.2,a,0")
    assert line.startswith("hgorun: u: no value has come by t = 0.1")


def test_a_stream_that_goes_on_begins_nowhere(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    config = CONFIG.replace("initial: {a: 0, b: 1}", "initial: {b: 1}")
    assert len(told(shell, monkeypatch, config, "0.1,a,0", "--checkpoint", "kept")) == 1
    assert not told(shell, monkeypatch, config, "0.2,a,0", "--checkpoint", "kept")


def test_a_stream_that_goes_on_knows_its_inputs(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    told(shell, monkeypatch, DRIVEN, "0,a,0 0,u,1 0,v,1 0.1,a,0", "--checkpoint", "kept")
    assert not told(shell, monkeypatch, DRIVEN, "0.2,a,0 0.3,a,0", "--checkpoint", "kept")


def test_a_gate_that_locks_out_is_told_at_once(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the stream goes on: an operator sees no end of it."""
    config = CONFIG.replace(
        "{type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}",
        "{type: ekf, Q: {b: 0.1}, initial: {a: 0}, internal: {P: 1e-4}}",
    )
    rows = " ".join(f"{0.1 * k:.1f},a,{5 if k > 9 else 0}" for k in range(1, 61))
    lines = told(shell, monkeypatch, config, rows)
    assert lines[0].startswith("hgorun: o: by t = 2.9 the gate of a has left out 20 samples one after the other")
    assert len(lines) == 2
    assert "51 of them one after the other" in lines[1]


def test_what_a_gate_left_out_before_a_stream_goes_on_is_not_told_again(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    sure = "{type: ekf, Q: {b: 0.1}, initial: {a: 0}, internal: {P: 1e-4}}"
    config = CONFIG.replace("{type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}", sure)
    rows = [f"{0.1 * k:.1f},a,{5 if 9 < k < 31 else 0}" for k in range(1, 51)]
    assert len(told(shell, monkeypatch, config, " ".join(rows[:40]), "--checkpoint", "kept")) == 2
    (line,) = told(shell, monkeypatch, config, " ".join(rows[40:]), "--checkpoint", "kept")
    assert "the gate of a left out 21 of 50" in line  # at the end


def test_numbers_that_stand_for_no_value_are_told(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    config = CONFIG.replace("time: t", "time: t\n  csv: {missing: [bad, -9999]}")
    (line,) = told(shell, monkeypatch, config, "0.1,a,0")
    assert "data.csv.missing: values of a stream are taken whatever they are: leave out those of -9999" in line


def test_a_measured_state_that_begins_elsewhere_than_in_a_file_is_told(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    (line,) = told(shell, monkeypatch, CONFIG.replace("initial: {a: 0, b: 1}", "initial: {b: 1}"), "0.1,a,0")
    assert line == (
        "hgorun: c: o: in a stream a starts at 0, and in a file at its first sample: give observers.o.initial"
    )
