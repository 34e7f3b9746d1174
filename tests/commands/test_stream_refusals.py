"""What a stream refuses, as files do: numbers that are none, keys that stand twice, options without an effect."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pendulum_log import write
from shell import Shell

from hgorun.files import _MACHINE

ARABIC = "\u0661\u0662"  # 12


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    write(tmp_path)
    return Shell(tmp_path, monkeypatch, capsys)


def as_text(text: str) -> io.StringIO:
    return io.StringIO(text)


def as_bytes(text: str) -> io.TextIOWrapper:
    """Of which many lines are taken together."""
    return io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8")


@pytest.mark.parametrize("of", [as_text, as_bytes])
@pytest.mark.parametrize("cell", ["1_0", ARABIC, "0x10", "1 0"])
@pytest.mark.parametrize("column", ["t", "y"])
def test_cells_are_numbers_as_in_files(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, of: Callable[[str], io.TextIOBase], cell: str, column: str
) -> None:
    rows = [f"0.{k},a,0.1" for k in range(1, 7)]
    rows[4] = f"{cell},a,0.1" if column == "t" else f"0.5,a,{cell}"
    monkeypatch.setattr(sys, "stdin", of("\n".join(["t,signal,y", *rows, ""])))
    code, out, err = shell("estimate", "pendulum.yaml", "-")
    assert (code, len(out.splitlines())) == (2, 5)
    assert f"standard input:6: {column}: expected a number, found" in err


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('{"t": 0.1, "signal": "a", "y": "1"}', "y: expected a number, found the text '1'"),
        ('{"t": "0.1", "signal": "a", "y": 1}', "t: expected a number, found the text '0.1'"),
        ('{"t": 0.1, "signal": "a", "y": 1, "available": "0.2"}', "available: expected a number, found the text"),
        (
            '{"t": "2026-11-28T10:00:00Z", "signal": "a", "y": 1}',
            "t: expected a number, found the text '2026-11-28T10:00:00Z': times",
        ),
        ('{"t": 0.1, "signal": "a", "val": 1}', "unknown key 'val'. Did you mean `y`?"),
        ('{"t": 0.1, "signal": "a", "vol": 1}', "the key y is missing"),
        ('{"t": 0.1, "signal": "a", "y": 1, "avail": 1}', "unknown key 'avail'. Did you mean `available`?"),
        ('{"t": 0.1, "signal": "a", "y": 1, "y": 2}', "the key y stands twice"),
        ("t,signal,y,t", "the column t stands twice"),
    ],
)
def test_what_is_not_clear(shell: Shell, monkeypatch: pytest.MonkeyPatch, line: str, message: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(line + "\n"))
    code, _, err = shell("estimate", "pendulum.yaml", "-")
    assert code == 2
    assert f"standard input:1: {message}" in err


def test_a_missing_value_may_be_text(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = [f'{{"t": 0.{k}, "signal": "a", "y": {y}}}' for k, y in enumerate(['""', '"nan"', "NaN", "null", "0.1"], 1)]
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n".join(lines)))
    code, out, _ = shell("estimate", "pendulum.yaml", "-")
    assert (code, len(out.splitlines())) == (0, 5)


def test_a_further_key_is_none_that_has_some_of_its_letters(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"t": 0.1, "signal": "a", "y": 0.1, "val": 2}\n'))
    code, out, _ = shell("estimate", "pendulum.yaml", "-")
    assert (code, len(out.splitlines())) == (0, 1)


def test_a_date_as_time_is_told_how_times_are_counted(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n2026-11-28 10:00:00,a,1\n"))
    code, _, err = shell("estimate", "pendulum.yaml", "-")
    assert code == 2
    assert (
        "t: expected a number, found '2026-11-28 10:00:00': times of a stream are numbers in the unit time.unit" in err
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-", "--export-samples", "x.csv"], "--export-samples writes the samples of files"),
        (["-", "--json"], "--json is for results: a stream is answered in its own form, so send objects of JSON"),
        (["log.csv", "-"], "- is a stream; there are no files beside it"),
        (["log.csv", "mqtt://localhost/a"], "mqtt://localhost/a is a stream; there are no files beside it"),
    ],
)
def test_options_that_a_stream_has_no_use_for(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n"))
    code, out, err = shell("estimate", "pendulum.yaml", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert not Path("x.csv").exists()


def test_late_samples_go_back_as_far_as_is_remembered(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [f"0.{k},a,0.1," for k in range(1, 8)]
    late = "\n".join(["t,signal,y,available", *rows, "0.25,a,0.1,0.8", ""])
    for given, expected in ((["--remembered", "3"], 2), (["--remembered", "6"], 0), ([], 0)):
        monkeypatch.setattr(sys, "stdin", io.StringIO(late))
        code, _, err = shell("estimate", "pendulum.yaml", "-", *given)
        assert code == expected
        assert ("standard input:9: a sample taken at 0.25 is older than all that is remembered" in err) == bool(code)
    code, _, err = shell("estimate", "pendulum.yaml", "--remembered", "3")
    assert code == 2
    assert "--remembered, --publish and --client-id are for streams" in err


@pytest.mark.skipif(os.name != "posix", reason="asks whether a process lives")
def test_half_of_a_checkpoint_of_a_killed_stream_is_removed(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    dead = Path(f".state-{_MACHINE}-{ended.stdout.strip()}-abc.part")
    alive, other = Path(f".state-{_MACHINE}-{os.getpid()}-abc.part"), Path(".note.part")
    for one in (dead, alive, other):
        one.write_bytes(b"half")
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0.1,a,0.1\n"))
    code, _, _ = shell("estimate", "pendulum.yaml", "-", "--checkpoint", "state")
    assert code == 0
    assert [one.exists() for one in (dead, alive, other)] == [False, True, True]
