"""Pages as Jupyter notebooks: what a reader writes, types and runs becomes a cell."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from site_steps import Step, steps


def notebook(page: str) -> str:
    """The notebook of a page, without outputs.

    Parameters
    ----------
    page : str
        Markdown.
    """
    cells = [_cell(i, kind, text) for i, (kind, text) in enumerate(_cells(steps(page)))]
    metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return json.dumps({"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


def _cells(found: list[Step]) -> Iterator[tuple[str, str]]:
    for step in found:
        if step.kind == "file":
            yield "code", f"%%writefile {step.name}\n{step.text}"
        elif step.kind == "command":
            yield "code", f"!{step.text}"
        elif step.kind == "python":
            yield "code", step.text
        else:
            yield "markdown", step.text


def _cell(number: int, kind: str, text: str) -> dict[str, Any]:
    cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text.rstrip("\n")}
    return cell | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def write(pages: Path, folder: Path) -> list[Path]:
    """Write the notebooks of all pages in a folder; those of pages without anything to run are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for page in sorted(pages.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if any(step.kind == "command" and step.text.startswith("pip ") for step in steps(text)):
            continue  # a package is written with an editor, not in a notebook
        file = folder / f"{page.stem}.ipynb"
        content = notebook(text)
        if not file.is_file() or file.read_text(encoding="utf-8") != content:
            file.write_text(content, encoding="utf-8")
        written.append(file)
    return written
