"""Packages of other people, installed for one test."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hgorun.registry import Registry

DOCS = Path(__file__).parents[1] / "docs"


def code_of(page: str, containing: str) -> str:
    """The one block of Python on a page of the documentation that contains a text."""
    (found,) = [block for block in blocks_of(page) if containing in block]
    return found


def blocks_of(page: str) -> list[str]:
    """All blocks of Python on a page of the documentation."""
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


@contextmanager
def installed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, registry: Registry[Any], module: str, code: str, **names: str
) -> Iterator[None]:
    """A distribution with one module, whose entry points name its objects: name=object."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(code)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    entries = "".join(f"{name} = {module}:{thing}\n" for name, thing in names.items())
    (info / "entry_points.txt").write_text(f"[{registry.group}]\n{entries}")
    with monkeypatch.context() as patch:
        patch.syspath_prepend(folder)
        try:
            yield
        finally:
            sys.modules.pop(module, None)
            for name in names:
                registry.forget(name)
