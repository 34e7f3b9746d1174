"""The page of licences is that of what is installed."""

import importlib.util
import re
import tomllib
from email.message import Message
from importlib.metadata import Distribution
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool() -> Any:
    spec = importlib.util.spec_from_file_location("licences", ROOT / "tools" / "licences.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def listed() -> dict[str, tuple[str, str]]:
    text = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([a-z0-9-]+) \| (\S.*?) \| (.*?) ?\|$", text, re.MULTILINE)
    return {name: (licence, extras) for name, licence, extras in rows if name != "package"}


def test_every_dependency_is_listed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {name: some for name, some in project["optional-dependencies"].items()}
    named = {name: "" for name in project["dependencies"]}
    named |= {one: extra for extra in ("dask", "explore", "mqtt", "parquet", "xarray") for one in extras[extra]}
    found = listed()
    for requirement, extra in named.items():
        name = re.split("[><=]", requirement)[0].lower()
        assert name in found, requirement
        assert extra in found[name][1].split(", "), requirement


@pytest.mark.slow  # with the lowest versions other packages are there
def test_what_is_installed_has_the_licence_that_the_page_says(tool: Any) -> None:
    """What another package needs from some version on may be missing on the page, if its licence is a known one."""
    found = listed()
    different = {name: licence for name, licence, _ in tool.rows() if found.get(name, (licence,))[0] != licence}
    assert not different


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"License-Expression": "MIT"}, "MIT"),
        ({"License": "BSD 2-Clause License"}, "BSD-2-Clause"),
        ({"License": "see file", "Classifier": "License :: OSI Approved :: Apache Software License"}, "Apache-2.0"),
        ({"License": "GNU Lesser General Public License v3 or later (LGPLv3+)"}, "LGPL-3.0-or-later"),
    ],
)
def test_a_licence_is_found_wherever_it_is_stated(tool: Any, fields: dict[str, str], name: str) -> None:
    assert tool.licence(_package(fields)) == name


def test_what_is_not_known_is_not_passed_over(tool: Any) -> None:
    with pytest.raises(ValueError, match="one: no known licence"):
        tool.licence(_package({"License": "ask me"}))


def _package(fields: dict[str, str]) -> Distribution:
    head = Message()
    for key, value in ({"Name": "one"} | fields).items():
        head[key] = value
    return cast(Distribution, SimpleNamespace(metadata=head))
