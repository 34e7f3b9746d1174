"""The version of hgorun, where everything may ask for it."""

from __future__ import annotations

from pathlib import Path

__version__ = "0.2.0"
RELEASED = "2026-11-26"
"""The date of that version."""

_CHECKOUT = Path(__file__).parents[1]


def source_revision(checkout: Path = _CHECKOUT) -> str:
    """The git commit of the checkout that the program runs from, else the version.

    Git's files are read, not its program, which takes longer than a short run. Edits that were not committed are not
    seen.
    """
    try:
        git = checkout / ".git"
        if git.is_file():  # of a worktree: where the rest is
            git = checkout / git.read_text().removeprefix("gitdir:").strip()
        head = (git / "HEAD").read_text().strip()
        found = _commit(git, head.removeprefix("ref: ")) if head.startswith("ref: ") else head
    except (OSError, ValueError):
        return __version__
    return found if len(found) >= 40 and set(found) <= set("0123456789abcdef") else __version__


def _commit(git: Path, ref: str) -> str:
    """Where a branch stands; worktrees share the branches."""
    shared = git / "commondir"
    common = git / shared.read_text().strip() if shared.is_file() else git
    for place in (git / ref, common / ref):
        if place.is_file():
            return place.read_text().strip()
    packed = (line.split() for line in (common / "packed-refs").read_text().splitlines())
    return next((words[0] for words in packed if words[1:] == [ref]), "")
