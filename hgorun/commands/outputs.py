"""What commands have in common about the files that they write."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Literal

from hgorun.errors import ConfigError
from hgorun.files import RESULT_SUFFIXES, called_otherwise, real_path, refuse_original, why_unwritable

RESULTS = Path("results")
STDOUT = Path("-")  # in the place of a file, where a command takes it
NOT_OK = 3  # exit code of --strict
DRAWING_SUFFIXES = {".png", ".pdf"}
_CSV = (".csv", ".dat", ".txt")
_TABLE = "; hgorun compare{} prints a table, which > FILE writes"
_ADVICE = {
    ".csv": _TABLE.format(" --format csv"),
    ".tex": _TABLE.format(" --format latex"),
    ".txt": _TABLE.format(""),
    ".json": "; --json prints JSON, which > FILE writes",
    ".png": "; hgorun compare -o FILE.png draws",
    ".pdf": "; hgorun compare -o FILE.pdf draws",
}


def refuse_other_kinds(
    output: Path | None,
    suffixes: Collection[str],
    advice: Mapping[str, str] | None = None,
    *,
    default: Path | None = None,
) -> None:
    """Refuse an ``--output`` that is called like a file of a kind that the command does not write, or is unwritable.

    A folder that exists may be called anything. What is passed here needs no other check, but for files in a folder,
    whose names are known when the configuration has been read.

    Parameters
    ----------
    output : Path or None
    suffixes : collection of str
        The kinds of files that it writes into one that is named.
    advice : mapping of str to str
        What the right way is for a suffix, where the command has one of its own.
    default : Path, optional
        The folder that is written to where no output is given.
    """
    if output is None:
        if default is not None:
            refuse_unwritable(default, kind="folder")
        return
    _refuse_stdout("--output", output)
    _refuse_other_kinds(output, suffixes, advice or {})
    refuse_unwritable(output)


def _refuse_stdout(option: str, path: Path) -> None:
    if path == STDOUT:
        raise ConfigError(f"{option}: - is the standard output, and what is written goes into files: name one")


def refuse_unwritable(path: Path, option: str = "--output", kind: Literal["file", "folder", ""] = "") -> None:
    """Refuse a file, or a folder, that cannot be written, before the work whose results would be lost.

    Parameters
    ----------
    path : Path
    option : str
        By which somebody names it.
    kind : {"file", "folder", ""}
        Which of them it has to be; either, by default.

    Raises
    ------
    ConfigError
    """
    refuse_original(path, option)
    if path.suffix.lower() in RESULT_SUFFIXES and os.path.isfile(path):
        from hgorun.result.hdf5.forms import refuse_not_ours  # only where something would be replaced

        refuse_not_ours(path, option)
    if kind == "file" and os.path.isdir(path):
        why = "it is a folder"
    elif kind == "folder" and os.path.isfile(path):
        why = "it is a file, not a folder"
    else:
        why = why_unwritable(path)
    if why:
        raise ConfigError(f"{option}: {path} cannot be written: {why}; name another place with {option}")


def _refuse_other_kinds(output: Path, suffixes: Collection[str], advice: Mapping[str, str]) -> None:
    if os.path.isdir(output):  # of a name that is too long, too, there is none
        return
    suffix = output.suffix.lower()
    if suffix in suffixes or not (called_otherwise(output, suffixes) or os.path.isfile(output)):
        return
    kinds = f"a file {', '.join(sorted(suffixes))} or a folder" if suffixes else "a folder"
    advised = f"; {advice[suffix]}" if suffix in advice else _ADVICE.get(suffix, "")
    instead = advised or ("" if os.path.isfile(output) else "; if it is a folder, make it first")
    raise ConfigError(f"--output: expected {kinds}, found {output}{instead}")


def refuse_no_configuration(path: Path, name: str, option: str) -> None:
    """Refuse a file that is not called as a configuration is.

    Parameters
    ----------
    path : Path
    name : str
        What a file in this folder would be called, where it is one.
    option : str
        By which somebody names it.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        right = path / f"{name}.yaml" if os.path.isdir(path) else path.with_suffix(".yaml")
        raise ConfigError(f"{option}: expected a file whose name ends in .yaml, such as {right}, found {path}")


def refuse_no_csv(option: str, file: Path | None, *, or_stdout: bool = False) -> None:
    """Refuse a file that is called as if it were something else than CSV, or that cannot be written."""
    if file is None or (or_stdout and file == STDOUT):
        return
    _refuse_stdout(option, file)
    if file.suffix and file.suffix.lower() not in _CSV and not os.path.exists(file):
        raise ConfigError(f"{option}: expected a file {', '.join(_CSV)}, found {file}")
    if os.path.isdir(file):
        raise ConfigError(f"{option}: expected a file {', '.join(_CSV)}, found the folder {file}")
    refuse_unwritable(file, option)


def refuse_same(export: Path, targets: Iterable[Path]) -> None:
    """Refuse an ``--export-csv`` that is one of the result files."""
    if real_path(export) in map(real_path, targets):
        raise ConfigError(f"--export-csv: {export} is to be the file of the result, too: name another file")


def formats(output: Path | None) -> tuple[str, ...]:
    """In which formats figures are written: in that of the file that is named, else in both."""
    suffix = "" if output is None else output.suffix.lower()
    return (suffix[1:],) if suffix in DRAWING_SUFFIXES else ("png", "pdf")


def there(files: Iterable[Path]) -> frozenset[Path]:
    """Those files that exist: a command that writes them replaces them."""
    return frozenset(file for file in files if os.path.exists(file))


def written(files: Iterable[Path | str], before: Collection[Path] = ()) -> str:
    """The line that says which files a command has written, and which of them it has replaced."""
    return "written: " + ", ".join(f"{file} (replaced)" if Path(file) in before else str(file) for file in files)
