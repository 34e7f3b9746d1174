"""The page of the Python interface: its code runs, and so do the examples in the docstrings that it shows."""

from __future__ import annotations

import doctest
import re
from pathlib import Path
from typing import Any

import pytest

import hgorun

PAGE = (Path(__file__).parents[2] / "docs" / "api.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the code of the page leaves behind."""
    found: dict[str, Any] = {"hgorun": hgorun}
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(code, found)
    return found


def test_the_page_shows_all_that_hgorun_offers() -> None:
    shown = set(re.findall(r"^\.\. auto\w+:: hgorun\.(\w+)$", PAGE, re.MULTILINE))
    assert shown == set(hgorun.__all__) - {"__version__"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in hgorun.__all__ if ">>>" in (getattr(hgorun, name).__doc__ or "")])
def test_examples_of_docstrings_run(
    name: str, names: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text(CONFIG)
    tests = [one for one in doctest.DocTestFinder(recurse=True).find(getattr(hgorun, name), name) if one.examples]
    assert tests
    short = {"experiment": names["experiment"].varied({"time.end": 0.2, "solver.step": 0.01})}
    offered = {name: getattr(hgorun, name) for name in hgorun.__all__}
    for one in tests:
        for example in one.examples:
            example.source = example.source.replace("[2, 20, 10]", "[2, 20, 2]").replace('"count": 20', '"count": 2')
        one.globs = names | offered | short
        assert doctest.DocTestRunner(verbose=False).run(one).failed == 0


CONFIG = """
time: {end: 1, output_step: 0.1}
plant: {states: [a, b], dynamics: {a: b, b: -a}, output: {y: a}, initial: {a: 1, b: 0}}
measurement: {sampling: {period: 0.1}}
observers: {SHGO: {type: shgo, theta: 2}}
solver: {step: 0.01}
"""
