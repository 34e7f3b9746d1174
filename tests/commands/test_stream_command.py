"""``hgorun estimate`` of streams: lines as they come, checkpoints, grids of their own."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pendulum_log import write
from shell import Shell
from typing_extensions import Buffer

from hgorun.commands.held import held_alone
from hgorun.commands.stream_lines import Sample
from hgorun.commands.stream_lines import read as read_lines
from hgorun.errors import ConfigError


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    write(tmp_path)
    return Shell(tmp_path, monkeypatch, capsys)


def piped(shell: Shell, monkeypatch: pytest.MonkeyPatch, text: str, *arguments: str) -> tuple[int, list[str], str]:
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    code, out, err = shell("estimate", "pendulum.yaml", "-", *arguments)
    return code, out.splitlines(), err


def bytes_of(text: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8")


def stream(count: int) -> list[str]:
    return [f"{0.1 * k:.1f},a,{np.sin(0.1 * k):.4f}" for k in range(1, count)]


def test_a_stream_gives_a_line_as_soon_as_it_is_known(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    code, out, err = piped(shell, monkeypatch, "\n".join(["t,signal,y", *stream(30), ""]))
    assert (code, err) == (0, "")
    assert out[0] == "t,observer,a,b,status"
    assert len(out) == 30
    assert out[-1].startswith("2.9,o,")
    assert out[-1].endswith(",ok")
    objects = [{"t": float(t), "signal": s, "y": float(y)} for t, s, y in (row.split(",") for row in stream(30))]
    code, lines, _ = piped(shell, monkeypatch, "\ufeff" + "\n".join(map(json.dumps, objects)))  # a byte order mark
    assert code == 0
    assert piped(shell, monkeypatch, "\n".join(["\ufefft,signal,y", *stream(30), ""]))[:2] == (0, out)
    last = json.loads(lines[-1])
    assert [repr(last["a"]), repr(last["b"])] == out[-1].split(",")[2:4]


@pytest.mark.measured
@pytest.mark.slow
def test_what_a_stream_leaves_undone_is_told(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    of_file = (
        "plant.inputs={w: '0'}",
        "plant.dynamics.b=w - sin(a)",
        "plant.units={a: rad}",
        "data.inputs={w: {column: w, hold: linear}}",
        "data.time={column: t, unit: ms}",
        "data.outputs.a={column: angle, unit: deg, plausible: [-1, 1], quality: {column: state, good: [0]}}",
    )
    text = "t,signal,y\n0,w,0.1\n0.1,a,0.1\n"
    code, _, err = piped(shell, monkeypatch, text, *(word for one in of_file for word in ("--set", one)))
    assert code == 0
    assert [line.split(": ")[2] for line in err.splitlines()] == [
        "data.time.unit",
        "data.outputs.a.unit",
        "data.inputs.w.hold",
        "data.outputs.a.plausible",
        "data.outputs.a.quality",
    ]
    plain = (*of_file[:3], "data.inputs={w: w}", "data.outputs.a.unit=rad")
    code, _, err = piped(shell, monkeypatch, text, *(word for one in plain for word in ("--set", one)))
    assert (code, err) == (0, "")


def test_what_gates_leave_out_of_a_stream_is_counted(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [(0.1 * k, np.sin(0.1 * k) + (5.0 if k in (20, 31) else 0.0), 0.5 * (k % 7 == 0)) for k in range(1, 40)]
    rows.sort(key=lambda row: row[0] + row[2])
    text = "t,signal,y,available\n" + "".join(f"{t:.1f},a,{y:.4f},{t + late:.1f}\n" for t, y, late in rows)
    code, _, err = piped(
        shell, monkeypatch, text, "--set", "observers={K: {type: ekf, Q: {b: 0.1}, R: 0.01, initial: {a: 0}}}"
    )
    assert (code, err) == (0, "hgorun: K: the gate of a left out 2 of 39 samples\n")


TOO_FAST = "observers.o.theta=4000"  # for steps of 0.02


@pytest.mark.parametrize("of", [io.StringIO, bytes_of])
@pytest.mark.parametrize(("set_", "strict", "wanted"), [(TOO_FAST, True, 3), (TOO_FAST, False, 0), ("seed=1", True, 0)])
def test_the_exit_code_says_whether_an_observer_of_a_stream_has_numbers(
    shell: Shell,
    monkeypatch: pytest.MonkeyPatch,
    of: Callable[[str], io.TextIOBase],
    set_: str,
    strict: bool,
    wanted: int,
) -> None:
    monkeypatch.setattr(sys, "stdin", of("\n".join(["t,signal,y", *stream(30)])))
    more = ["--strict"] if strict else []
    code, out, _ = shell("estimate", "pendulum.yaml", "-", "--set", CONSTANT, "--set", set_, *more)
    assert code == wanted
    assert out.splitlines()[-1].rpartition(",")[2] == ("diverged" if set_ == TOO_FAST else "ok")


@pytest.mark.parametrize(("bad", "wanted", "told"), [(2, 0, ""), (12, 3, ", too many for outliers: look at")])
def test_the_exit_code_says_whether_a_gate_leaves_out_too_many_samples(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, bad: int, wanted: int, told: str
) -> None:
    """Also where the process goes on from a checkpoint behind the last one that was left out."""
    kalman = ("--set", "observers={K: {type: ekf, Q: {b: 0.1}, R: 0.01}}", "--strict", "--checkpoint", "state")
    lines = [f"{0.1 * k:.1f},a,{np.sin(0.1 * k) + 5 * (10 <= k < 10 + bad):.4f}" for k in range(1, 31)]
    for end in (25, 30):
        code, _, err = piped(shell, monkeypatch, "\n".join(["t,signal,y", *lines[:end]]), *kalman)
        assert code == wanted
        assert f"hgorun: K: the gate of a left out {bad} of {end} samples{told}" in err


@pytest.mark.parametrize(("bad", "wanted"), [(19, 0), (20, 3)])
def test_samples_that_are_left_out_one_after_the_other_are_told(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, bad: int, wanted: int
) -> None:
    """Also where they are no more than a fifth of all."""
    kalman = ("--set", "observers={K: {type: ekf, Q: {b: 0.01}, R: 0.01}}", "--strict")
    lines = [f"{0.1 * k:.1f},a,{np.sin(0.1 * k) + 20 * (60 <= k < 60 + bad):.4f}" for k in range(1, 121)]
    code, _, err = piped(shell, monkeypatch, "\n".join(["t,signal,y", *lines]), *kalman)
    assert code == wanted
    assert f"K: the gate of a left out {bad} of 120 samples" in err
    assert ("20 of them one after the other, too many for outliers: look at" in err) == (bad == 20)


def test_a_stream_on_a_grid_of_its_own(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    _, out, _ = piped(
        shell, monkeypatch, "\n".join(["t,signal,y,available", "0.1,a,0.1,0.3", "1.0,a,0.8,"]), "--every", "0.25"
    )
    assert [row.split(",")[0] for row in out[1:]] == ["0.0", "0.25", "0.5", "0.75"]


def test_a_stream_goes_on_from_its_checkpoint(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = stream(40)
    _, whole, _ = piped(shell, monkeypatch, "\n".join(["t,signal,y", *lines]))
    _, first, _ = piped(shell, monkeypatch, "\n".join(["t,signal,y", *lines[:13]]), "--checkpoint", "state")
    _, rest, _ = piped(shell, monkeypatch, "\n".join(["t,signal,y", *lines]), "--checkpoint", "state")
    assert first + rest[1:] == whole


def test_a_second_stream_with_the_same_checkpoint_is_refused(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "t,signal,y\n0.1,a,0.1\n"
    with held_alone(shell.folder / "state"):
        for data in ((), ("mqtt://127.0.0.1:1/plant/a",)):
            monkeypatch.setattr(sys, "stdin", io.StringIO(text))
            code, out, err = shell("estimate", "pendulum.yaml", *(data or ("-",)), "--checkpoint", "state")
            assert (code, out) == (2, "")
            assert "state: another process has it in use (.state.lock is locked): end that process, or name" in err
        assert piped(shell, monkeypatch, text, "--checkpoint", "other")[0] == 0
    assert piped(shell, monkeypatch, text, "--checkpoint", "state")[0] == 0
    assert not list(shell.folder.glob(".*"))


@pytest.mark.parametrize(("key", "first", "then"), [("std", "0.02", "0.05"), ("gate", "4", "6")])
def test_a_stream_does_not_go_on_with_another_std_or_gate(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, key: str, first: str, then: str
) -> None:
    for value, wanted in ((first, 0), (then, 2), (first, 0)):
        column = f"data.outputs.a={{column: angle, {key}: {value}}}"
        code, _, err = piped(shell, monkeypatch, "t,signal,y\n0.1,a,0.1\n", "--set", column, "--checkpoint", "state")
        assert code == wanted
        name = "gates" if key == "gate" else key
        assert not code or f"state: the checkpoint was made with {name} {{a: {first}}}, and this" in err


CONSTANT = "data.outputs.a={column: angle, std: 0.02}"


TWO = ("--set", "plant.output={a: a, z: b}")


AT_ONE_TIME = ["0.1,a,0.1", "0.1,z,1", "0.2,a,0.2", "0.2,z,0.9", "0.2,a,0.2", "0.3,z,0.95", "0.3,a,0.3", "0.4,a,0.4"]


@pytest.mark.measured("False-StringIO")
@pytest.mark.slow
@pytest.mark.parametrize("of", [io.StringIO, bytes_of])
@pytest.mark.parametrize("resent", [True, False])
def test_a_checkpoint_between_signals_of_one_time_loses_nothing(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, of: Callable[[str], io.TextIOBase], resent: bool
) -> None:
    def follow(lines: list[str], *more: str) -> list[str]:
        monkeypatch.setattr(sys, "stdin", of("\n".join(["t,signal,y", *lines])))
        code, out, err = shell("estimate", "pendulum.yaml", "-", *TWO, "--set", CONSTANT, *more)
        assert (code, err) == (0, "")
        return out.splitlines()[1:]

    whole = follow(AT_ONE_TIME)
    found, first = [], 0
    for last in (1, 5, 6, 8):  # how many samples have come when it ends, and is started again
        found += follow(AT_ONE_TIME[0 if resent else first : last], "--checkpoint", "state")
        first = last
    assert found == whole


def test_a_grid_goes_on_from_a_checkpoint(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["t,signal,y", "0.1,a,0.1", "0.5,a,0.5", "0.85,a,0.7", "1.3,a,0.9"]
    _, whole, _ = piped(shell, monkeypatch, "\n".join(lines), "--every", "0.1")
    found = []
    for last in (2, 3, 4, 5):
        _, out, _ = piped(shell, monkeypatch, "\n".join(lines[:last]), "--every", "0.1", "--checkpoint", "state")
        found += out[1:]
    assert found == whole[1:]
    assert len(found) == 13


def test_a_stamp_that_is_far_ahead_is_refused_before_anything_is_shown(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, out, err = piped(shell, monkeypatch, "t,signal,y\n0,a,0.1\n1.7e9,a,1\n", "--every", "1e6")
    assert code == 2
    assert out == ["t,observer,a,b,status"]
    assert "standard input:3" in err


def test_a_folder_in_place_of_a_checkpoint_is_named(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "folder").mkdir()
    folder = str(tmp_path / "folder")
    code, out, err = piped(shell, monkeypatch, "t,signal,y\n0,a,1\n", "--checkpoint", folder)
    assert (code, out) == (2, [])
    assert f"--checkpoint: {folder} cannot be written: it is a folder; name another place with --checkpoint" in err


@pytest.mark.parametrize(
    ("stored", "message"),
    [
        (b"x", "not a checkpoint of a stream"),
        (b"hgorun-stream-1 [0]\n", "is damaged"),
        (b"hgorun-stream-1 [0, 0, [], 1]\n", "is damaged"),
    ],
)
def test_a_file_that_is_no_checkpoint_is_named(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, stored: bytes, message: str
) -> None:
    (shell.folder / "state").write_bytes(stored)
    code, out, err = piped(shell, monkeypatch, "t,signal,y\n", "--checkpoint", "state")
    assert (code, out) == (2, [])
    assert "state: " in err
    assert message in err


@pytest.mark.parametrize("text", ["", "\n", "garbage\n", "time,y\n1,2\n"])
def test_nothing_is_written_for_an_input_that_is_no_stream(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    code, out, err = piped(shell, monkeypatch, text)
    assert (code, out) == (2, [])
    assert "expected the header" in err


def test_objects_may_have_further_keys_and_null_is_a_missing_sample() -> None:
    (sample,) = samples_of('{"t": 1, "signal": "a", "y": null, "unit": "rad", "dt": 0.1, "id": 7}')
    assert sample[:3] == (1, 1.0, "a")
    assert np.isnan(sample.y)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,y\n", "standard input:1: expected the header t,signal,y"),
        ("t;signal;y\n", "found 't;signal;y'; cells are separated by commas, and decimals have a point"),
        ("t,signal,y\n0.1,a,0.1\n0.05,a,1\n", "standard input:3: t = 0.05 is before 0.1"),
        ("t,signal,y\n0.1,b,0.1\n", "standard input:2: no output is called 'b'"),
        ("t,signal,y\n0.1,a\n", "standard input:2: expected 3 cells, found 2"),
        ("t,signal,y\n0.1,a,x\n", "standard input:2: y: expected a number"),
        ("t,signal,y\nnan,a,1\n", "standard input:2: t: expected a number"),
        ("t,signal,y\n0.1,,1\n", "standard input:2: signal: expected a name"),
        ('{"t": 0.1, "signal": "a", "y": 1}\n{"t"\n', "standard input:2: not JSON"),
        ('{"t": 0.1, "signal": "a", "y": 1}\n[1]\n', "standard input:2: expected an object"),
        ("{}\n", "standard input:1: the key t is missing"),
        ('{"t": 0.1, "signal": "a"}\n', "standard input:1: the key y is missing (null stands for a missing sample)"),
        ('{"t": 0.1, "signal": "a", "Y": 1}\n', "standard input:1: unknown key 'Y'. Did you mean `y`?"),
        ('{"t": 0.1, "signal": "a", "y": 1, "availabel": 1}\n', "Did you mean `available`?"),
    ],
)
def test_a_wrong_line_is_named(shell: Shell, monkeypatch: pytest.MonkeyPatch, text: str, message: str) -> None:
    code, _, err = piped(shell, monkeypatch, text)
    assert code == 2
    assert message in err


def both(shell: Shell, monkeypatch: pytest.MonkeyPatch, text: str, *more: str) -> list[tuple[int, str, str]]:
    """What a stream gives line by line, and all lines at once."""
    found = []
    for stdin in (io.StringIO(text), bytes_of(text)):
        monkeypatch.setattr(sys, "stdin", stdin)
        found.append(shell("estimate", "pendulum.yaml", "-", "--set", CONSTANT, *more))
    return found


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n0.5,a,", "\n0.5, a ,"),
        lambda text: text.replace("\n0.5,", "\n\n0.5,"),
        lambda text: text.replace("\n2.0,", "\n1.95,a,nan\n2.0,"),
        lambda text: text + "5.5,a,0.1\n0.1,a,0.2\n6,a,1\n",
        lambda text: text + "5.5,b,0.1\n",
        lambda text: text + "5.5,a,x\n",
        lambda text: text.rstrip("\n"),
    ],
)
def test_lines_that_come_together_give_what_they_give_one_by_one(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, change: Callable[[str], str]
) -> None:
    one_by_one, together = both(shell, monkeypatch, change("\n".join(["t,signal,y", *stream(50), ""])))
    assert one_by_one == together
    assert len(together[1].splitlines()) >= 50


def test_lines_that_come_together_behind_a_checkpoint(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["t,signal,y", *stream(50)]
    whole, _ = both(shell, monkeypatch, "\n".join(lines))
    monkeypatch.setattr(sys, "stdin", bytes_of("\n".join(lines[:20])))
    _, first, _ = shell("estimate", "pendulum.yaml", "-", "--set", CONSTANT, "--checkpoint", "state")
    monkeypatch.setattr(sys, "stdin", bytes_of("\n".join(lines)))
    _, rest, _ = shell("estimate", "pendulum.yaml", "-", "--set", CONSTANT, "--checkpoint", "state")
    assert first + rest.split("\n", 1)[1] == whole[1]


class Pieces(io.RawIOBase):
    """Bytes that come piece by piece."""

    def __init__(self, *pieces: bytes) -> None:
        super().__init__()
        self.left = list(pieces)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Buffer) -> int:
        piece = self.left.pop(0) if self.left else b""
        memoryview(buffer)[: len(piece)] = piece
        return len(piece)


def test_a_line_is_not_kept_waiting_for_the_next_one() -> None:
    raw = Pieces(b"t,signal,y\n", b"1,a,\xc2", b"\xb5\n2,a,3\n4", b",a,5\n", b"6,a")
    _, late, blocks = read_lines(io.TextIOWrapper(io.BufferedReader(raw), encoding="utf-8"))
    assert not late
    assert len(raw.left) == 4  # the header is known before anything follows
    found = []
    for block in blocks:
        found.append((block.first, block.lines, len(raw.left)))
    assert found == [(2, ["1,a,\u00b5", "2,a,3"], 2), (4, ["4,a,5"], 1), (5, ["6,a"], 0)]


class Interrupted(Pieces):
    """Bytes, and then an end that is none."""

    def __init__(self, text: str, end: BaseException) -> None:
        super().__init__(text.encode())
        self._end = end

    def readinto(self, buffer: Buffer) -> int:
        if not self.left:
            raise self._end
        return super().readinto(buffer)


def interrupted(text: str, end: BaseException) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BufferedReader(Interrupted(text, end)), encoding="utf-8")


@pytest.mark.parametrize(("end", "code"), [(KeyboardInterrupt(), 130), (SystemExit(143), 143), (None, 2)])
def test_what_has_been_taken_is_kept_however_a_stream_ends(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, end: BaseException | None, code: int
) -> None:
    lines = ["t,signal,y", *stream(9)]
    _, whole, _ = piped(shell, monkeypatch, "\n".join(lines))
    begun = "\n".join([*lines[:6], "" if end else "0.6,a,x"])
    monkeypatch.setattr(sys, "stdin", interrupted(begun, end) if end else io.StringIO(begun))
    found, first, _ = shell("estimate", "pendulum.yaml", "-", "--checkpoint", "state")
    assert found == code
    _, rest, _ = piped(shell, monkeypatch, "\n".join(lines), "--checkpoint", "state")
    assert first.splitlines() + rest[1:] == whole


def test_a_stream_that_was_stopped_before_its_first_sample_leaves_no_checkpoint(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", interrupted("t,signal,y\n", KeyboardInterrupt()))
    assert shell("estimate", "pendulum.yaml", "-", "--checkpoint", "state")[0] == 130
    assert not (shell.folder / "state").exists()


def test_a_stream_needs_a_step(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    code, _, err = piped(shell, monkeypatch, "t,signal,y\n", "--set", "solver.step=auto")
    assert code == 2
    assert "needs solver.step" in err


def samples_of(text: str) -> list[Sample]:
    """The samples of a stream, one by one."""
    form, _, blocks = read_lines(io.StringIO(text))
    return [sample for block in blocks for sample in form.samples(block)]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"t": 0, "signal": "a", "y": 1' + "0" * 400 + "}", "y: expected a number"),
        ('{"t": 0, "signal": ' + "[" * 50_000, "not JSON"),
    ],
)
def test_numbers_and_lists_without_end_are_refused_with_their_line(line: str, said: str) -> None:
    with pytest.raises(ConfigError, match=f"input:1: {said}"):
        samples_of(line)


def test_names_in_a_stream_may_be_quoted() -> None:
    text = '"t","signal","y"\n0,"a",1\n'
    assert [one.signal for one in samples_of(text)] == ["a"]
    form, _, blocks = read_lines(io.StringIO(text))
    together = form.together(next(blocks), {"a": 7})
    assert together is not None
    assert together.kinds.tolist() == [7]


def test_a_point_that_is_a_sample_on_paper_is_behind_it(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 0.7 on, sums of the start and multiples of a step lie before some of the stamps, and behind others."""
    stamps = [round(0.7 + 0.1 * k, 1) for k in range(40)]
    assert {np.sign(0.7 + 0.1 * k - t) for k, t in enumerate(stamps)} == {-1.0, 0.0, 1.0}
    lines = ["t,signal,y", *(f"{t},a,{np.sin(9 * t):.4f}" for t in stamps)]
    of_time = ("--set", "time.start=0.7", "--set", "time.end=9")
    _, expected, _ = piped(shell, monkeypatch, "\n".join(lines), *of_time)
    _, found, _ = piped(shell, monkeypatch, "\n".join(lines), *of_time, "--every", "0.1")
    assert found == expected[:-1]  # of the last it is not known yet whether there is more
    parts = []
    for last in (8, 41):
        text = "\n".join(lines[:last])
        parts += piped(shell, monkeypatch, text, *of_time, "--every", "0.1", "--checkpoint", "state")[1][1:]
    assert parts == found[1:]
