"""Coverage of forked children, where files are read and figures are made.

coverage's own patches for forks search the whole package and save what the parent has run, too: half a second for
every file that is read. Here a child goes on with its parent's measurement, of which it saves what it has run itself,
unless another child has run just that; and nothing where its parent does not measure.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import coverage

ROOT = Path(__file__).parents[1]


def measure_forks() -> None:
    """From now on."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_begin)


def _begin() -> None:
    import posix  # where there is no fork, there is none

    parent = coverage.Coverage.current()
    collector = None if parent is None else parent._collector  # public is only a second Coverage, a tenth of a second
    if collector is None:
        os._exit = posix._exit
        return
    for arcs in collector.data.values():
        arcs.clear()

    def saved(status: int) -> NoReturn:
        with suppress(Exception):
            collector.pause()
            base = os.environ.get("COVERAGE_FILE", str(ROOT / ".coverage"))
            file = f"{base}.fork-{_digest(collector.data)}"
            if not Path(file).exists():
                collector.covdata = coverage.CoverageData(f"{file}-{os.getpid()}")
                collector.flush_data()
                os.replace(f"{file}-{os.getpid()}", file)
        posix._exit(status)  # os._exit is coverage's, which saves what the parent has run

    os._exit = saved


def _digest(arcs: Mapping[str, object]) -> str:
    found = sorted((file, sorted(ran)) for file, ran in arcs.items() if ran)  # type: ignore[call-overload]
    return hashlib.sha256(repr(found).encode()).hexdigest()[:20]
