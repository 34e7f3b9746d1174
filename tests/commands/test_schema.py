"""The JSON schemas for editors: they are those of the program, and every file that comes with it keeps to its own."""

import copy
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import yaml

import hgorun
from hgorun.commands.compact_schema import compact
from hgorun.commands.schema import (
    benchmark_schema,
    build_schema,
    full_schema,
    schema_text,
    sweep_schema,
    with_schema,
)
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


@pytest.mark.unmeasured
@pytest.mark.slow  # other versions of pydantic write the same schema in other words
def test_the_schemas_and_the_lines_that_name_them_are_those_that_the_tool_writes() -> None:
    line = [sys.executable, str(ROOT / "tools" / "schemas.py"), "--check"]
    done = subprocess.run(line, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert (done.returncode, done.stdout) == (0, ""), f"python tools/schemas.py:\n{done.stdout}{done.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_file_keeps_to_the_schema_that_it_names(file: Path) -> None:
    schema = named_schema(file)
    assert schema.is_relative_to(ROOT / "experiments")  # which the wheel takes along as a whole
    validator(schema).validate(yaml.safe_load(file.read_text()))


@pytest.mark.costly
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


@pytest.mark.costly
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


WRONG: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    2,
    0.5,
    "x",
    "1/2",
    [],
    [1, 2],
    ["x"],
    {},
    {"x1": 1},
    {"type": "shgo", "theta": 2},
)


def places(part: Any) -> list[tuple[Any, Any]]:
    """Every (mapping or list, key) of a document."""
    inner = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    return [place for key, value in inner for place in [(part, key), *places(value)]]


def mutated(document: dict[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """The document with a value replaced, a key left out, or a key misspelt."""
    changed = copy.deepcopy(document)
    known = places(changed)
    part, key = known[random.integers(len(known))]
    how = random.integers(4)
    if how == 0:
        del part[key]
    elif how == 1 and isinstance(part, dict):
        part[f"{key}s"] = part.pop(key)
    else:
        part[key] = copy.deepcopy(WRONG[random.integers(len(WRONG))])
    return changed


@pytest.fixture(scope="module")
def full_and_compact() -> tuple[jsonschema.protocols.Validator, jsonschema.protocols.Validator]:
    full = full_schema()
    return jsonschema.Draft202012Validator(full), jsonschema.Draft202012Validator(compact(full))


@pytest.mark.costly
@pytest.mark.measured_once
@pytest.mark.parametrize(("share", "changes"), [(8, 1), pytest.param(2, 6, marks=pytest.mark.slow)])
def test_the_compact_schema_takes_and_refuses_what_the_full_one_does(
    full_and_compact: tuple[jsonschema.protocols.Validator, jsonschema.protocols.Validator], share: int, changes: int
) -> None:
    full, short = full_and_compact
    random, refused = np.random.default_rng(1), 0
    files = [file for file in FILES if named_schema(file).name == "hgorun.schema.json"][::share]
    for file in files:
        document = yaml.safe_load(file.read_text())
        for one in (document, *(mutated(document, random) for _ in range(changes))):
            valid = full.is_valid(one)
            assert short.is_valid(one) == valid, (file, one)
            refused += not valid
    assert refused > len(files) * changes / 4  # not for lack of faults


@pytest.mark.slow
@pytest.mark.parametrize("made", [build_schema, sweep_schema, benchmark_schema])
def test_the_schema_is_small_and_says_what_every_key_means(made: Callable[[], dict[str, Any]]) -> None:
    schema = made()
    assert len(schema_text(schema)) < 120_000
    assert compact(schema) == schema  # nothing is left to do
    for name, block in schema["$defs"].items():
        for key, one in block.get("properties", {}).items():
            while "description" not in one and "$ref" in one:
                one = schema["$defs"][one["$ref"].removeprefix("#/$defs/")]
            assert "description" in one or "const" in one, f"{name}.{key}"


@pytest.mark.parametrize(
    ("part", "valid"),
    [
        ({"observers": {"Z": None}}, True),  # which removes an inherited one
        ({"measurement": {"sampling": None}}, True),
        ({"figures": {"1": None}, "claims": None}, True),
        ({"observers": {"Z": {"type": "shgo", "theta": None}}}, True),
        ({"observers": {"Z": {"type": None}}}, False),
        ({"observers": {"Z": 3}}, False),
        ({"time": {"end": "", "rows": None}}, False),  # no key
    ],
)
def test_null_is_allowed_where_it_removes_an_inherited_key(part: dict[str, Any], valid: bool) -> None:
    assert validator(ROOT / "experiments" / "hgorun.schema.json").is_valid(part) == valid
