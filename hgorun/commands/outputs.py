"""What commands have in common about the files that they write."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from hgorun.errors import ConfigError

RESULTS = Path("results")
NOT_OK = 3  # exit code of --strict
RESULT_SUFFIXES = {".h5", ".hdf5", ".nc"}
DRAWING_SUFFIXES = {".png", ".pdf"}
_OF_OTHERS = {".csv", ".htm", ".html", ".json", ".mat", ".npz", ".svg", ".tex", ".txt", ".yaml", ".yml"}


def refuse_other_kinds(output: Path | None, suffixes: Collection[str]) -> None:
    """Refuse an ``--output`` that is called like a file of a kind that the command does not write."""
    if output is None or output.is_dir():
        return
    suffix = output.suffix.lower()
    known = RESULT_SUFFIXES | DRAWING_SUFFIXES | _OF_OTHERS
    if suffix in suffixes or (suffix not in known and not output.is_file()):
        return
    kinds = f"a file {', '.join(sorted(suffixes))} or a folder" if suffixes else "a folder"
    form = {".csv": " --format csv", ".tex": " --format latex", ".txt": ""}.get(suffix)
    tables = "" if form is None else f"; hgorun compare{form} prints a table, which > FILE writes"
    raise ConfigError(f"--output: expected {kinds}, found {output}{tables}")
