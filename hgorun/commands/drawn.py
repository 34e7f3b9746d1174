"""Which figures ``compare`` has drawn, said where it does not disturb a table for another program."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from hgorun.commands.ensemble_options import Compare
from hgorun.commands.outputs import written
from hgorun.process import say


def tell_drawn(drawn: Sequence[Path], before: Collection[Path], options: Compare) -> None:
    """On the output below a table for people, on stderr beside one for programs; ``before``: files that were there."""
    if not drawn or options.quiet:
        return
    if options.text and options.format == "text":
        print(written(drawn, before))
    else:
        say(f"hgorun: {written(drawn, before)} (--no-plots draws none)")
