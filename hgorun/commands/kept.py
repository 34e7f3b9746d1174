"""What is said of changes that do not reach all runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hgorun.process import say

if TYPE_CHECKING:
    from hgorun.commands.options import Configured
    from hgorun.commands.run_options import Explore


def tell_what_runs_keep(path: Path, options: Configured | Explore) -> None:
    """Say on stderr which runs of a file a change by ``--set`` or ``--seed`` does not reach."""
    if options.overrides or options.seed is not None:
        from hgorun.study.kept import kept_by_runs  # a run without changes starts sooner

        for words in kept_by_runs(path, options.overrides, options.seed, options.run):
            say(f"hgorun: {path}: {words}")
