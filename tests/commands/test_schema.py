"""The JSON schemas for editors: they are those of the program, and every file that comes with it keeps to its own."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import hgorun
from hgorun.commands.schema import benchmark_schema, build_schema, schema_text, with_schema
from hgorun.config.tuning import Tune

ROOT = Path(__file__).parents[2]
FILES = sorted(
    file
    for folder in ("experiments", "demos")
    for file in (ROOT / folder).rglob("*.yaml")
    if file.name != "_publication.yaml"  # what is known of a publication: no configuration
)
SHARED: dict[Path, jsonschema.protocols.Validator] = {}  # {path: validator} of schemas that have been read


def validator(path: Path) -> jsonschema.protocols.Validator:
    if path not in SHARED:
        jsonschema.Draft202012Validator.check_schema(json.loads(path.read_text()))
        SHARED[path] = jsonschema.Draft202012Validator(json.loads(path.read_text()))
    return SHARED[path]


def named_schema(file: Path) -> Path:
    """The schema that a file's first line names for editors."""
    start, _, address = file.read_text().splitlines()[0].partition("=")
    assert start == "# yaml-language-server: $schema"
    return (file.parent / address).resolve()


@pytest.mark.slow  # other versions of pydantic write the same schema in other words
def test_the_schemas_and_the_lines_that_name_them_are_those_that_the_tool_writes() -> None:
    line = [sys.executable, str(ROOT / "tools" / "schemas.py"), "--check"]
    done = subprocess.run(line, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert (done.returncode, done.stdout) == (0, ""), f"python tools/schemas.py:\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_file_keeps_to_the_schema_that_it_names(file: Path) -> None:
    schema = named_schema(file)
    assert schema.is_relative_to(ROOT / "experiments")  # which the wheel takes along as a whole
    validator(schema).validate(yaml.safe_load(file.read_text()))


@pytest.mark.parametrize(
    "wrong",
    [
        {"tme": {}},
        {"observers": {"a": {"type": "shgo", "theta": 1, "tetha": 2}}},
        {"seed": -1},
        {"plant": {"type": "contois", "colour": "red"}},
        {"claims": [{"id": "1"}]},
    ],
)
def test_the_schema_refuses_what_the_loader_refuses(wrong: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        validator(ROOT / "experiments" / "hgorun.schema.json").validate(wrong)


@pytest.mark.parametrize(
    "tune",
    [
        "{gains: {observers.A.theta: {log: [1, 9]}}, minimise: hf(A, x2)}",
        "{gains: {observers.A.theta: {log: [1, 9]}}, minimise: [hf(A, x2), settling(A, x2)]}",
        "{gains: {observers.A.theta: {log: [1, 9]}}, minimise: rmse(A, x2), subject: [{value: peak(A, x2), below: 3}]}",
    ],
)
def test_the_schema_takes_quantities_as_the_loader_does(tune: str) -> None:
    block = yaml.safe_load(tune)
    assert Tune.model_validate(block).minimise[-1].endswith("(A, x2)")
    validator(ROOT / "experiments" / "hgorun.schema.json").validate({"tune": block})


def test_the_schema_of_benchmarks_knows_the_keys_of_observers() -> None:
    schema = jsonschema.Draft202012Validator(benchmark_schema())
    right = yaml.safe_load((ROOT / "experiments" / "benchmark" / "benchmark.yaml").read_text())
    schema.validate(right)
    next(iter(right["observers"].values()))["block"]["tetha"] = 2
    assert not schema.is_valid(right)


def test_a_schema_as_text_is_the_schema() -> None:
    made = build_schema()
    text = schema_text(made)
    assert json.loads(text) == made
    assert text.count("\n") < 2 * len(made["$defs"]) + 1000


def test_the_line_is_written_once_and_says_nothing_of_the_experiment(tmp_path: Path) -> None:
    text = "# mine\ntime: {end: 1, output_step: 0.1}\nplant: {type: van_der_pol, initial: {x1: 1, x2: 0}}\n"
    text += "observers: {A: {type: shgo, theta: 2}}\nsolver: {step: 0.1}\n"
    once = with_schema(text, "a.json")
    assert once == f"# yaml-language-server: $schema=a.json\n{text}"
    assert with_schema(once, "../b.json") == once.replace("a.json", "../b.json")
    resolved = []
    for name, content in (("plain.yaml", text), ("named.yaml", once)):
        (tmp_path / name).write_text(content)
        resolved.append(hgorun.load(tmp_path / name).resolved_text)
    assert resolved[0] == resolved[1]
