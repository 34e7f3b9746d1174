"""What results are called where several stand side by side."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.result.data import ResultData


def run_names(results: Sequence[ResultData]) -> list[str]:
    """Names of results, numbered where two are called the same."""
    names: list[str] = []
    for result in results:
        name, number = result.name, 2
        while name in names:
            name, number = f"{result.name} ({number})", number + 1
        names.append(name)
    return names
