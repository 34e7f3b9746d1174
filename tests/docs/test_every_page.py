"""Every block of code and every command of every page is tried by some test: here, or by the one that is named here."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import typer
import yaml
from site_steps import steps

import hgorun
from hgorun.cli import app
from hgorun.commands.schema import benchmark_schema, build_schema, sweep_schema

ROOT = Path(__file__).parents[2]
PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "tutorials").glob("*.md")})
# page: the test that runs what it shows. Of the others this file tries blocks of YAML and the options of commands.
TRIED = {
    "README.md": "tests/test_readme.py",
    "docs/api.md": "tests/docs/test_api_page.py",
    "docs/bioreactor_log.md": "tests/test_bioreactor_log.py",
    "docs/closed_loop.md": "tests/test_closed_loop_page.py",
    "docs/estimate.md": "tests/test_estimate_page.py",
    "docs/export.md": "tests/export/test_command.py",
    "docs/extending.md": "tests/testing/test_extending.py",
    "docs/fermentation.md": "tests/test_fermentation.py",
    "docs/interop.md": "tests/interop/test_interop_page.py",
    "docs/recordings.md": "tests/data/test_recordings_page.py",
    "docs/sweeps.md": "tests/test_sweeps_page.py",
    "docs/tuning.md": "tests/test_tuning_page.py",
    **{
        f"docs/tutorials/{page.name}": "tests/docs/test_tutorials.py"
        for page in PAGES
        if page.parent.name == "tutorials"
    },
}


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_code_of_a_page_is_run_by_a_test(page: Path) -> None:
    """Python, TOML and C say nothing as long as nobody runs them."""
    if any(blocks(page, language) for language in ("python", "toml", "c")):
        test = ROOT / TRIED[named(page)]
        folder, name = page.parent.name, page.name
        assert f'"{name}"' in test.read_text() or f"/{name}" in test.read_text() or f'/ "{folder}"' in test.read_text()


@cache
def schemas() -> list[Any]:
    """Of configurations, or parts of them, of sweeps, of what is tuned, and of benchmarks."""
    found = [build_schema(), sweep_schema(), benchmark_schema()]
    for schema in found:
        schema.pop("required", None)
    return [jsonschema.Draft202012Validator(schema) for schema in found]


def yaml_blocks() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for text in blocks(page, "yaml"):
            yield named(page), text


@pytest.mark.slow
@pytest.mark.parametrize(("page", "text"), list(yaml_blocks()))
def test_yaml_of_a_page_fits_the_schema(page: str, text: str) -> None:
    data = yaml.safe_load(text)
    if OWN & set(re.findall(r"type: (\w+)", text)):
        return  # of classes that the page itself defines, which its own test tries
    faults = [[error.message for error in schema.iter_errors(data)] for schema in schemas()]
    tuned = isinstance(data, dict) and set(data) == {"base", "tune"}
    assert tuned or not all(faults), min(faults, key=len)


OWN = {"own_ekf", "tank", "chirp", "leaky", "levitation", "pi_observer"}

BASE = """
time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -x1}
  output: {y: x1}
  initial: {x1: 1.5, x2: 15}
measurement: {delay: 0.2, noise: [{type: gaussian, std: 0.1, hold: 0.1}]}
observers: {SHGO: {type: shgo, theta: 2}}
solver: {step: 0.01}
"""


@pytest.mark.parametrize(
    "text", [t for t in blocks(ROOT / "docs" / "configuration.md", "yaml") if t.startswith(("observers:\n", "plant:"))]
)
def test_blocks_of_the_configuration_page_are_accepted(text: str) -> None:
    config = yaml.safe_load(BASE) | yaml.safe_load(text)
    if "FHGO r=2" in text or "EKF" in text:  # an innovation between samples, and an observer of samples
        config["measurement"] = {"sampling": {"period": 0.1}}
    assert hgorun.Experiment(config).observers


def commands() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for step in steps(page.read_text(encoding="utf-8")):
            if step.kind == "command" and step.text.startswith("hgorun "):
                yield named(page), step.text


@pytest.mark.slow
@pytest.mark.parametrize(("page", "command"), list(commands()))
def test_commands_of_a_page_have_options_that_there_are(page: str, command: str) -> None:
    known: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    for part in command.split("#")[0].split("&&"):
        words = shlex.split(re.sub(r"[\[\]]", " ", part))
        options = {
            option for parameter in known[words[1]].params for option in parameter.opts + parameter.secondary_opts
        }
        assert {word.split("=")[0] for word in words if word.startswith("--")} <= options
