"""Coverage of forked children, where files are read and figures are made.

coverage's own patches for forks search the whole package and save what the parent has run, too: half a second for
every file that is read. Here a child saves only what it has run itself, and nothing where its parent does not measure.
"""

from __future__ import annotations

import os
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
    if parent is None:
        os._exit = posix._exit
        return
    parent.stop()
    file = os.environ.get("COVERAGE_FILE", str(ROOT / ".coverage"))
    inside = [str(ROOT / "hgorun" / "*")]
    own = coverage.Coverage(file, data_suffix=True, branch=True, include=inside, config_file=False)
    own.start()

    def saved(status: int) -> NoReturn:
        with suppress(Exception):
            own.stop()
            own.save()
        posix._exit(status)  # os._exit is coverage's, which saves what the parent has run

    os._exit = saved
