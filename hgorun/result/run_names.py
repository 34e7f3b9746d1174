"""What results are called where several stand side by side."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.result.records.data import ResultData


def run_names(results: Sequence[ResultData]) -> list[str]:
    """Names of results, numbered where two are called the same."""
    return numbered([result.name for result in results])


def numbered(names: Sequence[str]) -> list[str]:
    """Names, numbered where two are the same: ``a``, ``a (2)``."""
    found: list[str] = []
    for name in names:
        own, number = name, 2
        while own in found:
            own, number = f"{name} ({number})", number + 1
        found.append(own)
    return found
