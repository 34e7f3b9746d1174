"""``hgorun analyze`` of a configuration of recorded data says how its observers are analysed along the model."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from shell import Shell

from hgorun.config import yaml_source

PLANT = "plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1 + u}, output: x1}\n"
OBSERVER = "observers: {S: {type: shgo, theta: 2}}\n"
DATA = "data: {file: log.csv, time: t, outputs: {x1: {column: y, std: 0.1}}, inputs: {u: u}, period: 0.05}\n"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            PLANT + OBSERVER + DATA,
            "--set data=null --set time.end=10 --set time.output_step=0.01 --set measurement.sampling.period=0.05 "
            "--set 'measurement.noise=[{type: gaussian, std: 0.1}]' --set 'plant.inputs={u: 1}' "
            "--set 'plant.initial={x1: 1, x2: 1}' --set 'observers.S.initial={x1: 1}'",
        ),
        (
            "plant: {states: [h], output: {level: h}, initial: {h: 3}}\ndata: {outputs: {level: y}}\n"
            "observers: {A: {initial: {}}, B: {initial: {h: 2}}, C: {initial: 4}, D: 5}\n",
            "--set data=null --set time.end=10 --set time.output_step=0.01 --set measurement.sampling.period=0.01 "
            "--set observers.A.initial.h=3",
        ),
        (
            "plant: {type: van_der_pol}\ndata: {file: log.csv, outputs: [y]}\ntune: {}\n",
            "--set data=null --set tune=null --set time.end=10 --set time.output_step=0.01 --set "
            "measurement.sampling.period=0.01 --set 'plant.initial={x1: 1, x2: 1}'",
        ),
        (
            "plant: {type: mine}\ntime: {output_step: 0.2}\ndata: {file: log.csv}\n",
            "--set data=null --set time.end=10 --set measurement.sampling.period=0.2 --set 'plant.initial={}'",
        ),
    ],
)
def test_the_command_puts_a_way_of_the_model_in_place_of_the_log(shell: Shell, text: str, words: str) -> None:
    (shell.folder / "a b.yaml").write_text(text if "time" in text.split("data")[0] else f"time: {{}}\n{text}")
    code, _, err = shell("analyze", "a b.yaml")
    assert (code, f"`hgorun analyze 'a b.yaml' {words}`" in err) == (2, True), err


REACTOR = (
    "plant: {states: [S, X], dynamics: {S: -S/(1 + S)*X + 2 - S, X: S/(1 + S)*X - 0.1*X}, output: S}\n"
    "data: {file: log.csv, time: t, outputs: {S: {column: y, std: 0.1}}, period: 0.05}\n"
)


@pytest.mark.costly
@pytest.mark.parametrize(
    "text",
    [
        PLANT + OBSERVER + DATA,
        REACTOR + "observers: {S: {type: shgo, theta: 2, initial: {X: 0.4}}}\n",  # at S = 0 X is not observed
    ],
)
def test_the_command_works_as_it_stands(shell: Shell, text: str) -> None:
    (shell.folder / "a.yaml").write_text(f"time: {{unit: s}}\n{text}")
    words = shlex.split(re.findall("`hgorun (analyze [^`]*)`", shell("analyze", "a.yaml")[2])[0])
    code, out, err = shell(*words, "--no-plots")
    assert (code, "period 0.05000 s" in out) == (0, True), err


def test_the_file_is_read_once(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    (shell.folder / "a.yaml").write_text(
        f"time: {{end: 1, output_step: 0.1}}\n{PLANT}observers: {{S: {{type: shgo}}}}\n"
    )
    parse, read = yaml_source.parse, list[str]()

    def counted(text: str, file: str) -> yaml_source.Source:
        read.append(file)
        return parse(text, file)

    monkeypatch.setattr(yaml_source, "parse", counted)
    code, _, err = shell("analyze", "a.yaml", "--seed", "3")
    assert code == 2, err
    assert read == ["a.yaml"]


@pytest.mark.parametrize("noise", ["", ", std: 0.02"])
def test_the_std_of_a_log_is_told_to_be_no_noise_of_a_run(shell: Shell, noise: str) -> None:
    """The configuration is one of a run, too: an R that is missing there may follow from noise of the log's size."""
    text = (
        "time: {end: 1, output_step: 0.1}\n"
        "plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1}, output: x1, initial: {x1: 1, x2: 0}}\n"
        "measurement: {sampling: {period: 0.1}}\n"
        f"data: {{file: log.csv, time: t, outputs: {{x1: {{column: y{noise}}}}}}}\n"
        "observers: {E: {type: ekf, q: 1}}\n"
    )
    (shell.folder / "a.yaml").write_text(text)
    code, _, err = shell("analyze", "a.yaml")
    assert (code, "observers.E.R: R of output x1 does not follow" in err) == (2, True), err
    assert ("--set 'measurement.noise=[{type: gaussian, std: 0.02}]'" in err) == bool(noise)
