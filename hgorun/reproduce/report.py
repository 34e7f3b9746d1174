"""The report of a reproduction: figures, verdicts, errata, versions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hgorun.reproduce.job import Folders, Outcome, Work


def write_report(works: Sequence[Work], outcomes: Sequence[Outcome], folders: Folders) -> Path:
    """Write REPORT.md into the folder of the results."""
    raise NotImplementedError
