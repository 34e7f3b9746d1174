"""A configuration in the place of a result is answered with the commands that lead to one."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from shell import Shell

CONFIG = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
measurement: {noise: [{type: gaussian, std: 0.01, hold: 0.1}]}
observers: {S: {type: shgo, theta: 2}}
"""
MANY = "echo '{base: a b.yaml, axes: {seed: {count: 20}}}' > 'a b_many.yaml'", "hgorun sweep 'a b_many.yaml'"
ONE = "hgorun simulate 'a b.yaml'"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("text", "command", "what", "steps"),
    [
        (
            CONFIG,
            "report",
            "a configuration",
            (*MANY, "hgorun report 'results/a b_many.sweep.h5'", "hgorun compare 'a b.yaml'"),
        ),
        (CONFIG, "rerun", "a configuration", (ONE, "hgorun compare 'results/a b.h5'")),
        (
            CONFIG + "runs: {one: {seed: 2}, two: {seed: 3}}",
            "report",
            "a configuration",
            (
                MANY[0].replace(", axes", ", run: one, axes"),
                *(MANY[1], "hgorun report 'results/a b_many.sweep.h5'", "hgorun compare 'a b.yaml'"),
            ),
        ),
        (
            CONFIG + "runs: {one: {seed: 2}, two: {seeds: 3}}",
            "rerun",
            "a configuration",
            (ONE, "hgorun compare 'results/a b/one.h5'"),
        ),
        (
            CONFIG + "runs: {one: {seed: 2}, two: {seeds: 3}}",
            "report",
            "a configuration with ensembles",
            ("hgorun sweep 'a b.yaml'", "hgorun report 'results/a b/two.sweep.h5'"),
        ),
        (
            "base: c.yaml\naxes: {seed: {count: 2}}",
            "report",
            "a sweep file",
            ("hgorun sweep 'a b.yaml'", "hgorun report 'results/a b.sweep.h5'"),
        ),
        (
            "plant: {type: contois}\ndata: {file: log.csv}",
            "report",
            "a configuration of recorded data",
            ("hgorun estimate 'a b.yaml'", "hgorun compare 'results/a b.h5'"),
        ),
        ("{plants: {}, scenarios: []}", "report", "the file of a benchmark", ("hgorun benchmark 'a b.yaml'",)),
        (
            "{base: c.yaml, tune: {}}",
            "rerun",
            "a file that asks for the gains of another one",
            ("hgorun tune 'a b.yaml'",),
        ),
        ("plant: {type: contois}", "report", "a configuration", ()),
        ("hello", "report", "YAML without a plant", ("hgorun init",)),
    ],
)
def test_the_commands_are_those_of_what_the_file_says(
    shell: Shell, text: str, command: str, what: str, steps: tuple[str, ...]
) -> None:
    (shell.folder / "a b.yaml").write_text(text)
    code, _, err = shell(command, "a b.yaml")
    assert (code, f"this is {what}, not a result: " in err) == (2, True), err
    assert tuple(re.findall("`([^`]*)`", err)) == steps


@pytest.mark.slow
@pytest.mark.parametrize("text", [CONFIG, CONFIG + "runs: {one: {seed: 2}, two: {seeds: 3}}"])
def test_the_commands_lead_to_a_report(shell: Shell, text: str) -> None:
    """They are carried out as they stand, one after another."""
    (shell.folder / "a b.yaml").write_text(text)
    steps = re.findall("`([^`]*)`", shell("report", "a b.yaml")[2])
    for step in steps:
        words = shlex.split(step)
        if words[0] == "echo":
            (shell.folder / words[3]).write_text(words[1])
        else:
            code, _, err = shell(*words[1:])
            assert code == 0, err
    assert list((shell.folder / "results").rglob("*.html"))


def test_sweep_of_a_configuration_says_what_a_sweep_file_would_be(shell: Shell) -> None:
    (shell.folder / "a b.yaml").write_text(CONFIG)
    code, _, err = shell("sweep", "a b.yaml")
    assert (code, err.endswith(f"such as for 20 seeds: `{MANY[0]}`, then `{MANY[1]}`\n")) == (2, True), err
