"""What docs/sweeps.md shows is what happens."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import yaml
from shell import Shell

from hgorun.commands.schema import sweep_schema

PAGE = (Path(__file__).parents[1] / "docs" / "sweeps.md").read_text(encoding="utf-8")
BASE = """
time: {end: 0.5, output_step: 0.05}
plant: {type: academic, initial: {x1: 1, x2: 1, x3: 1}}
measurement: {noise: [{type: gaussian, std: 0.1, hold: 0.05}]}
observers: {FHGO: {type: fhgo1, theta: 3, delta: 3}}
solver: {step: 0.01}
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.costly
def test_the_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = blocks("yaml")
    (tmp_path / "academic.yaml").write_text(BASE)  # what Python loads
    (tmp_path / "gains.yaml").write_text(file.replace("2, 20, 10", "2, 20, 3").replace("count: 20", "count: 3"))
    shell = Shell(tmp_path, monkeypatch, capsys)
    commands = re.findall(r"^    hgorun (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 6
    for command in commands:
        assert shell(*shlex.split(command), "-q")[::2] == (0, "")
    for code in blocks("python"):
        exec(compile(code, "sweeps.md", "exec"), {})


@pytest.mark.costly
def test_files_that_are_right_fit_the_schema() -> None:
    import jsonschema

    schema = sweep_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    (file,) = blocks("yaml")
    assert validator.is_valid(yaml.safe_load(file))
    right = {"base": yaml.safe_load(BASE), "axes": {"solver.method": ["rk4", "euler"]}, "combine": "zip"}
    assert validator.is_valid(right)
    for axis in ({"uniform": [0, 1], "draws": 3}, {"normal": [0, 1], "draws": 3}, {"linear": [0, 1, 3]}):
        assert validator.is_valid(right | {"axes": {"a": axis}})
    for wrong in ({"axes": {"a": 3}}, {"combine": "grid"}, {"keep": {"trajectories": {"worst": 2}}}, {"base": 3}):
        assert not validator.is_valid(right | wrong)
