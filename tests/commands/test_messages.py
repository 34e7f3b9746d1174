"""Common mistakes are answered with what would be right, on one line that a terminal can show."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import pytest

from hgorun.cli import main
from hgorun.errors import ConfigError, Problem

RIGHT = """
time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -k*x1}
  output: x1
  parameters: {k: 2}
  initial: {x1: 1, x2: 0}
measurement:
  sampling:
    period: 0.25
observers:
  SHGO: {type: shgo, theta: 2}
solver: {step: 0.01}
"""


def refusal(
    folder: Path, text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str
) -> str:
    monkeypatch.chdir(folder)
    (folder / "c.yaml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["hgorun", *(arguments or ("simulate", "c.yaml"))])
    with pytest.raises(SystemExit) as stop:
        main()
    out, err = capsys.readouterr()
    assert (stop.value.code, out) == (2, "")
    assert err.count("\n") == 1
    assert err[:-1].isprintable()
    assert [p.name for p in folder.iterdir()] == ["c.yaml"]
    return err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("period: 0.25", "period: 0.25 h", "time.unit"),
        ("period: 0.25", "period: 0.25h", "time.unit"),
        ("period: 0.25", "period: 0.25\n  delay: 20ms", "c.yaml:12: measurement.delay"),
        ("period: 0.25", "period: 0,25", "written with a point"),
        ("\n    period: 0.25", " {period: 0,25}", "written with a point"),
        ("k: 2", "k: 4,39", "written with a point"),
        ("k: 2", "k: max(0, 2)", "a comma ends the entry"),
        ("initial: {x1: 1, x2: 0}", "initial: [1, 0]", "write lines `name: value`"),
        ("output: x1", "output: 1", "plant.output: 1.0 is a number"),
        ("output: x1", "output: {y: 2*3}", "such as x1"),
        ("k: 2", "k: 2, pi: 3", "plant.parameters: 'pi' is a name of a constant"),
        ("time:", "% a comment\ntime:", "a comment begins with #"),
        ("time:", "extends: nowhere.yaml\ntime:", "extends: nowhere.yaml: there is no such file"),
        ("time:", "extends: c.yaml\ntime:", "extends itself"),
        ("x2: -k*x1", "x2: -x2\n    x1: x2**2", "given twice"),
        ("states: [x1, x2]", "states: x1, x2", "expected a list, found 'x1, x2'; a list has brackets: [x1, x2]"),
        ("step: 0.01", "method: rk45", "expected 'auto', 'euler', 'rk4', 'dopri5' or 'rodas5p', found 'rk45'"),
        ("solver:", "run: {a: {}}\nsolver:", "unknown key 'run'. Did you mean `runs`?"),
        ("\n    period: 0.25", " continous", "found 'continous'. Did you mean `continuous`?"),
        ("states:", "type: contois\n  states:", "c.yaml:5: plant.states: unknown key 'states'. This type has its own"),
        ("output: x1", "output: {t: x1}", "plant.output: 't' is a name of time and of output; names must differ"),
        ("period: 0.25", "period: 0.25\u00a0", "� is a non-breaking space (U+00A0): type a plain space"),
        ("period: 0.25", "\u00a0period: 0.25", "found �period. Did you mean `period`? � is a non-breaking space"),
        ("output: x1", "output:\u202fx1", "� is a narrow non-breaking space (U+202F)"),
        ("output: x1", "output: x1\u200b", "c.yaml:6: plant.output: `x1�`: � is a space of no width (U+200B)"),
        ("  output: x1", "\u00a0\u00a0output: x1", "c.yaml:6: one `:` too many"),
    ],
)
def test_a_mistake_is_explained(
    old: str, new: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = RIGHT.replace("{x1: x2, x2: -k*x1}", "\n    x1: x2\n    x2: -k*x1") if "**" in new else RIGHT
    assert old in text
    assert says in refusal(tmp_path, text.replace(old, new, 1), monkeypatch, capsys)


def test_a_start_where_the_model_is_not_defined_is_not_called_singular(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = RIGHT.replace("output: x1", "output: x2").replace("x1: x2, x2: -k*x1", "x1: -k*x1, x2: sqrt(x1) - x2")
    err = refusal(tmp_path, text.replace("theta: 2", "theta: 2, initial: {x1: -0.8}"), monkeypatch, capsys)
    assert "observability map is not finite at the initial estimate (x1 = -0.8, x2 = 0)" in err


def test_a_configuration_is_not_taken_for_a_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "c.yaml: this is a configuration" in refusal(tmp_path, RIGHT, monkeypatch, capsys, "rerun", "c.yaml")


@pytest.mark.parametrize(("name", "what"), [("e", "a constant"), ("pi", "a constant"), ("t", "time")])
def test_a_state_does_not_hide_what_has_the_name(
    name: str, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    err = refusal(tmp_path, RIGHT.replace("x1", name), monkeypatch, capsys)
    assert f"c.yaml:4: plant.states: '{name}' is a name of {what}" in err


def test_a_default_estimate_where_the_map_is_singular(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = RIGHT.replace("{x1: x2, x2: -k*x1}", "{x1: x2**2, x2: -x2}").replace("  parameters: {k: 2}\n", "")
    err = refusal(tmp_path, text, monkeypatch, capsys)
    assert "give initial" in err


@pytest.mark.parametrize("base", ["- a list\n", "3\n", "text\n"])
def test_what_is_extended_is_a_mapping(
    base: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    below = tmp_path / "below"
    below.mkdir()
    (tmp_path / "base.yaml").write_text(base)
    err = refusal(below, f"extends: ../base.yaml\n{RIGHT}", monkeypatch, capsys)
    assert "c.yaml:1: extends: ../base.yaml holds " in err


@pytest.mark.parametrize(
    "text",
    [
        RIGHT.replace("SHGO:", '"\\e[31mred\\nlabel":'),
        RIGHT.replace("SHGO:", '"a\\0b":'),
        RIGHT.replace("SHGO:", '"\\u202eright to left":'),
        RIGHT.replace("SHGO:", f'"{"x" * 5000}":'),
        RIGHT.replace("SHGO:", f'"{"x" * 101}":'),
        RIGHT + 'title: "\\e]0;owned\\a"\n',
        RIGHT.replace("output_step: 0.1", 'output_step: 0.1, unit: "\\x9b31m"'),
        RIGHT.replace("period: 0.25", 'period: "\\U000e0001\\n1"'),
    ],
)
def test_nothing_steers_the_terminal(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(refusal(tmp_path, text, monkeypatch, capsys)) < 1_100


@pytest.mark.costly
@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "c.yaml", "--set", "\x1b[31m=1"),
        ("simulate", "c.yaml", "--set", "observers.\x1b[2J.theta"),
        ("simulate", "c.yaml", "--set", "title." + "x" * 100_000 + "=1"),
        ("simulate", "c.yaml", "--run", "\x1b[31m"),
        ("simulate", "\x1b[31mred\n.yaml"),
        ("compare", "\x1b[31mred\n.h5"),
        ("show", "\x1b[31m" + "y" * 5000),
        ("figures", "\x07bell"),
        ("init", "\x1b[1m"),
    ],
)
def test_echoes_of_the_command_line_are_harmless(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(refusal(tmp_path, RIGHT, monkeypatch, capsys, *arguments)) < 1_100


def test_errors_survive_the_way_back_from_a_worker() -> None:
    several = ConfigError("wrong", file="a.yaml", line=3, key="k")
    several.others = (ConfigError("wrong, too"),)
    error = pickle.loads(pickle.dumps(several))
    assert (str(error), error.line, str(*error.others)) == ("a.yaml:3: k: wrong", 3, "wrong, too")
    problem = pickle.loads(pickle.dumps(Problem(("time", 0), "wrong")))
    assert (problem.path, problem.message) == (("time", 0), "wrong")
