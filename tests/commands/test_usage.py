"""What is wrong with the words of a command line is said in the words of all other messages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer
import yaml
from shell import Shell
from typer.core import TyperGroup

from hgorun.cli import app
from hgorun.errors import ConfigError
from hgorun.tuning.loading import load_tuning
from hgorun.version import __version__

SMALL = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {S: {type: shgo, theta: 2}}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "a.yaml").write_text(SMALL)
    (tmp_path / "log.yaml").write_text(f"{SMALL}data: {{file: log.csv, time: t, outputs: {{x1: y}}}}\n")
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "compare a.yaml --plot",
            "there is no option --plot. Did you mean `--plots`? hgorun compare -h lists the options",
        ),
        ("compare a.yaml --no-plot", "there is no option --no-plot. Did you mean `--no-plots`?"),
        ("simulate a.yaml --no-plots", "there is no option --no-plots. It is an option of estimate, compare,"),
        ("simulate a.yaml --plot", "there is no option --plot. --plots is an option of estimate, compare,"),
        ("simulate a.yaml -x", "there is no option -x. hgorun simulate -h lists the options"),
        ("analyze a.yaml --observers S", "there is no option --observers. --observer is an option of export and init."),
        ("simulate a.yaml --obs S", "there is no option --obs. --observer is an option of export and init."),
        ("compare a.yaml --plant x", "there is no option --plant. It is an option of init. hgorun compare -h"),
        ("tune a.yaml -v", "there is no option -v. It is an option of analyze. hgorun tune -h lists the options"),
        (
            "simulate a.yaml --seeds 50",
            "there is no option --seeds. hgorun sweep takes many seeds, of a file with `base: CONFIG` and "
            "`axes: {seed: {count: 50}}`. hgorun simulate -h lists the options",
        ),
        ("sweep a.yaml --seeds 50", "there is no option --seeds. hgorun sweep takes many seeds, of a file with `base:"),
        ("compare a.yaml --latex", "there is no option --latex. Did you mean `--format latex`? hgorun compare -h"),
        ("export a.yaml --latex", "there is no option --latex. Did you mean `--lang latex`? hgorun export -h lists"),
        (
            "simulate a.yaml --latex",
            "there is no option --latex. `--format latex` is an option of compare. `--lang latex` is an option of exp",
        ),
        ("tune a.yaml --csv", "there is no option --csv. `--format csv` is an option of compare. hgorun tune -h lists"),
        ("compare a.yaml --zzzz", "there is no option --zzzz. hgorun compare -h lists the options"),
        ("cite nosuch", "nosuch: there is no such file. See hgorun list experiments"),
        ("simulate contois_t025", "contois_t025: there is no such file. Did you mean `contois_te025`? See hgorun list"),
        ("estimate fermentation", "fermentation: there is no such file. It is an experiment: hgorun init fermentation"),
        (
            "estimate a.yaml",
            "a.yaml: the key data is missing: it says which columns of which files are the measurements; "
            "`hgorun init fermentation` copies an example",
        ),
        (
            "tune a.yaml",
            "a.yaml: the key tune is missing: it says which gains to tune, and for which goal; such as tune: ",
        ),
        ("--verion", "there is no option --verion. Did you mean `--version`? hgorun -h lists the options"),
        ("--hlep", "there is no option --hlep. Did you mean `--help`? hgorun -h lists the options"),
        ("simulate --hlep", "there is no option --hlep. Did you mean `--help`? hgorun simulate -h lists the options"),
        ("compare a.yaml --plots=yes", "--plots is a switch, which takes no value; --no-plots is its opposite"),
        ("simulate a.yaml --json=1", "--json is a switch, which takes no value"),
        ("simulate a.yaml --seed", "--seed: a value is missing: --seed INTEGER"),
        ("simulate a.yaml -o", "-o: a value is missing: -o PATH"),
        ("estimate a.yaml --every x", "--every: expected a number of at least 0, found x"),
        ("simulate", "CONFIG... is missing: hgorun simulate CONFIG..."),
        (
            "simulate a.yaml --set observers.S.theta 3",
            "--set observers.S.theta: expected path=value, as in --set obser",
        ),
        (
            "simulate --set observers.S.theta -q a.yaml",
            "--set observers.S.theta: expected path=value, as in --set obse",
        ),
        ("simulate --set seed", "--set seed: expected path=value, as in --set seed=VALUE"),
        (
            "simulate a.yaml --set observers.S.theta = 5",
            "--set observers.S.theta: expected path=value, as in --set observers.S.theta=5",
        ),
        (
            "simulate a.yaml --set observers.S.theta =5",
            "--set observers.S.theta: expected path=value, as in --set observers.S.theta=5",
        ),
        (
            "simulate a.yaml --set observers.S.theta = -q",
            "--set observers.S.theta: expected path=value, as in --set observers.S.theta=VALUE",
        ),
        (
            "simulate a.yaml --set observers.S b=2.theta=5",
            "--set observers.S: expected path=value, as in --set 'observers.S b=2.theta=5'",
        ),
        ("simulate a.yaml --set title a*b", "--set title: expected path=value, as in --set 'title=a*b'"),
        (
            "simulate a.yaml --poles [-1,-2]",
            "there is no option --poles: keys of the configuration are changed by --set 'observers.LABEL.poles=[-1,",
        ),
        (
            "simulate a.yaml --set title=5",
            "--set title=5: title: expected text, found 5; as text: `--set 'title=\"5\"'`",
        ),
        ("simulate C:\\me\\tank.yaml", "C:\\me\\tank.yaml: there is no such file. Folders are separated by / here"),
        ("estimate log.yaml a.yaml", "a.yaml: this is a configuration, not a log: measurements are read from CSV, Par"),
        ("analyze a.yaml b.yaml", "b.yaml is one word too many: hgorun analyze CONFIG"),
        ("simulat a.yaml", "there is no command 'simulat'. Did you mean `simulate`? hgorun -h lists them"),
    ],
)
def test_one_line_says_what_would_be_right(shell: Shell, words: str, said: str) -> None:
    code, out, err = shell(*words.split())
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert err.startswith(f"hgorun: {said}"), err


def test_help_and_version_are_no_mistakes(shell: Shell) -> None:
    assert shell("--version")[:2] == (0, f"{__version__}\n")
    assert shell("simulate", "-h")[1].startswith("Usage: ")
    assert "Commands:" in "".join(shell()[1:])


def test_help_tells_a_default_once() -> None:
    """Not also the value that stands for "as the file says", and none that says nothing."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    shown = 0
    for name, command in group.commands.items():
        context = typer.Context(command, info_name=name)
        for param in command.get_params(context):
            if (record := param.get_help_record(context)) is not None:
                told = re.findall(r"\[default: (.*?)\]|\(default: (.*?)\)", record[1])
                assert len(told) <= 1, (name, record)
                assert not any(one.strip(".") in ("", "None", "0", "0.0", "[]") for pair in told for one in [max(pair)])
                shown += len(told)
    assert shown > 40


@pytest.mark.costly
def test_figures_beside_a_table_for_programs_are_told(shell: Shell) -> None:
    code, out, err = shell("compare", "a.yaml", "--format", "csv")
    assert (code, "written" in out) == (0, False)
    assert err == "hgorun: written: results/a-comparison.png, results/a-comparison.pdf (--no-plots draws none)\n"
    assert shell("compare", "a.yaml", "--format", "latex", "--no-plots")[2] == ""
    assert shell("compare", "a.yaml", "--format", "csv", "-q")[1:] == ("", "")


def test_the_block_that_tune_names_is_one(shell: Shell) -> None:
    """Of a configuration of a plant whose states are called so."""
    block = shell("tune", "a.yaml")[2].split("such as ")[1]
    (shell.folder / "b.yaml").write_text(SMALL + block + "seed: 0\n")
    with (shell.folder / "b.yaml").open() as file:
        assert yaml.safe_load(file)["tune"]["minimise"] == "rmse(*, x1)"
    assert len(load_tuning(shell.folder / "b.yaml").tasks) == 1


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        ("plant: {states: [q, w], output: q}\n", "minimise: 'rmse(*, q)'}"),
        ("plant: {type: contois}\n", "minimise: 'rmse(*, x1)'}"),
        ("plant: {type: mine}\n", "minimise: 'rmse(*, STATE)'}"),
        ("plant: [q]\n", "minimise: 'rmse(*, STATE)'}"),
        ("data: {outputs: {S: y}}\n", "minimise: 'holdout_rmse(*, S)'}"),
    ],
)
def test_the_block_that_tune_names_has_names_of_the_file(shell: Shell, text: str, goal: str) -> None:
    (shell.folder / "b.yaml").write_text(text)
    assert shell("tune", "b.yaml")[2].endswith(f"{goal}\n")


def test_tune_as_a_whole_is_set_for_one_call(shell: Shell) -> None:
    """A mapping is a value as any other; keys beside tune would be lacking in the tuned file."""
    found = load_tuning(
        shell.folder / "a.yaml", ["tune={gains: {observers.*.theta: {log: [1, 9]}}, minimise: 'rmse(*, x2)'}"]
    )
    assert [gain.range.ends for task in found.tasks for gain in task.gains] == [(1, 9)]
    with pytest.raises(ConfigError, match="only keys of tune"):
        load_tuning(shell.folder / "a.yaml", ["tuned={}"])
