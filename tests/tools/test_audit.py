"""What could not be audited is not called safe."""

import importlib.util
from pathlib import Path
from typing import Any

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "audit.py"
SKIPPED = {"name": "a", "skip_reason": "Dependency not found and could not be audited: a (1.0)"}
SAFE = {"name": "b", "version": "2.0", "vulns": []}
FAULTY = {"name": "c", "version": "3.0", "vulns": [{"id": "X-1", "fix_versions": ["3.1"]}]}


@pytest.mark.parametrize(
    ("packages", "lines", "code"),
    [
        ([SKIPPED], ["NOT AUDITED: no advisory data could be had for any package"], 0),
        ([SKIPPED, SAFE], ["1 of 2 packages audited, 0 advisories"], 0),
        ([SAFE, FAULTY], ["c 3.0: X-1, mended in 3.1", "2 of 2 packages audited, 1 advisories"], 1),
    ],
)
def test_what_is_told(packages: list[dict[str, Any]], lines: list[str], code: int) -> None:
    spec = importlib.util.spec_from_file_location("audit", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert tool.told({"dependencies": packages, "fixes": []}) == (lines, code)
