"""What the HDF5 files of hgorun are, by their attribute ``format``, and who reads which."""

from __future__ import annotations

from pathlib import Path

import h5py

from hgorun.config.kinds import HDF5, kind_of_file
from hgorun.errors import ConfigError, printable
from hgorun.result.hdf5.stored import IN_USE, LARGEST, opened

RESULT = "hgorun-result-1"
SWEEP = "hgorun-sweep-1"
TUNING = "hgorun-tune-1"
_WHAT = {
    RESULT: ("the result of a single run", "hgorun compare {0} shows it"),
    SWEEP: ("the result of a sweep", "hgorun compare {0} and hgorun report {0} show it"),
    TUNING: ("what hgorun tune has tried", "the gains that it found are in the file .tuned.yaml beside it"),
}


def form_of(path: Path) -> str | None:
    """The format of an HDF5 file that hgorun has written; None for other files, and those that cannot be read."""
    if kind_of_file(path) is not HDF5:
        return None
    try:
        found = opened(path, LARGEST, _stated)
    except ConfigError:
        return None  # whoever reads it says what is wrong
    return found if is_ours(found) else None


def refuse_not_ours(path: Path, option: str) -> None:
    """Refuse to replace a file of numbers that hgorun has not written: it may be a recording, which nobody makes again.

    One that cannot be opened, as it is cut off, may be replaced, but none that another program is writing.

    Parameters
    ----------
    path : Path
    option : str
        By which somebody names it.

    Raises
    ------
    ConfigError
    """
    kind = kind_of_file(path)
    if kind is None:
        return
    if kind is HDF5:
        try:
            if is_ours(opened(path, LARGEST, _stated)):
                return
        except ConfigError as error:
            if error.message != IN_USE:
                return
            message = f"{option}: {path} would be replaced, and {IN_USE}: name another file"
            raise ConfigError(message) from None
    raise ConfigError(
        f"{option}: {path} is {kind.what} that hgorun has not written, such as a recording, and would be replaced: "
        "name another file, or remove this one first"
    )


def _stated(file: h5py.File) -> str | None:
    found = file.attrs.get("format")
    return str(found) if isinstance(found, str) else None


def is_ours(form: object) -> bool:
    """Whether an attribute ``format`` is of hgorun."""
    return isinstance(form, str) and form.startswith("hgorun-")


def said_of(form: object) -> tuple[str, str]:
    """What an HDF5 file with such an attribute ``format`` is, and who reads it, in which ``{0}`` is its path."""
    if not isinstance(form, str) or not is_ours(form):
        return "an HDF5 file that hgorun has not written", "hgorun estimate CONFIG {0} reads it as a recording"
    version = printable(form)[:50]
    of_another = (f"a file of another version of hgorun ({version})", f"this version reads {', '.join(_WHAT)}")
    return _WHAT.get(form, of_another)


def not_this(form: object, wanted: str, path: Path) -> str:
    """What is wrong with a file that is not of the format that is wanted."""
    what, reader = said_of(form)
    other = f", not {_WHAT[wanted][0]}" if is_ours(form) else ""
    return f"this is {what}{other}: {reader.replace('{0}', str(path))}"
