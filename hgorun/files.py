"""Files that are written whole or not at all, and values as JSON holds them."""

from __future__ import annotations

import math
import os
import stat
import tempfile
import threading
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from errno import EACCES, EINVAL
from pathlib import Path
from typing import Any
from zlib import crc32

from hgorun.errors import ConfigError, HgorunError
from hgorun.originals import is_original
from hgorun.patterns import Pattern
from hgorun.process import unfinished

# Temporary files are called .NAME-MACHINE-PID-RANDOM.part: who finds one whose process is gone may remove it. Of the
# processes of other machines, which may share the folder, that is not known.
_HOST = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
_MACHINE = f"{crc32(_HOST.encode()):08x}"
_LEFTOVER = Pattern(rf"\..*-{_MACHINE}-(\d+)-[^-]*\.part")
_LONGEST_NAME = 255  # of the file systems in use
_LARGE = 1 << 26  # bytes of a file that is not given up in a moment

RESULT_SUFFIXES = frozenset((".h5", ".hdf5", ".nc"))
"""How names of files of results end."""
# What somebody writes behind the name of a file, never of a folder: letters first, unlike run.2 and results.v2.
_OF_A_FILE = Pattern(r"\.(?!v[0-9]+$)[a-z][a-z0-9]{0,7}")


def _mode() -> int:
    """What a new file would have: temporary files are private, results are not."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


FILE_MODE = _mode()  # asked for once, before there are threads: the question changes the process for a moment
"""Of new files."""


def real_path(path: Path) -> Path:
    """Where a path leads to through links, as far as they lead anywhere: that of :mod:`pathlib` fails on a loop."""
    return Path(os.path.realpath(path))


@contextmanager
def written_whole(path: Path, *, durable: bool = False) -> Iterator[Path]:
    """A temporary file beside ``path``, which takes its name when the block ends well and vanishes when not.

    Parameters
    ----------
    path : Path
    durable : bool
        Whether the file has to be there after a loss of power from then on; that takes milliseconds.

    Raises
    ------
    HgorunError
        When the file cannot be written.
    ConfigError
        When it is one that the command reads.
    """
    if "\0" in str(path):
        raise HgorunError(f"{str(path)!r}: cannot be written: a name of a file has no NUL")
    refuse_original(path)
    try:
        if path.is_symlink():
            path = real_path(path)  # what it points to is replaced, not the link
        if os.path.exists(path):
            _check_file(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        prefix = f".{path.name[:60]}-{_MACHINE}-{os.getpid()}-"
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=".part")
        os.close(handle)
        part = Path(name)
        unfinished.add(part)
        try:
            yield part
            os.chmod(part, FILE_MODE)
            if durable:
                _keep(part)
            _replace(part, path)
            if durable and os.name == "posix":
                _keep(path.parent)  # the new name, too
        finally:
            part.unlink(missing_ok=True)
            unfinished.discard(part)
    except OSError as error:
        raise HgorunError(f"{path}: cannot be written: {error.strerror or error}") from error


def _replace(part: Path, path: Path) -> None:
    """Give a file its name.

    To give back the room of a large one that had it takes the system a while: it does so in a thread, in which the last
    hold on it ends.
    """
    large = os.name == "posix" and os.path.exists(path) and os.path.getsize(path) > _LARGE
    held = os.open(path, os.O_RDONLY) if large and os.access(path, os.R_OK) else None
    try:
        os.replace(part, path)
    finally:
        if held is not None:
            threading.Thread(target=os.close, args=(held,), name="giving room back", daemon=True).start()


def why_unreachable(path: Path) -> str:
    """Why nothing could stand at a path: links in a loop, a name that is too long, a folder that is closed; or ""."""
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return ""
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        return str(getattr(error, "strerror", None) or error)
    return ""


def _check_file(path: Path) -> None:
    """Raise an OSError where something stands that is not to be replaced."""
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        raise OSError(EINVAL, "it is no regular file")
    if not mode & 0o222 or not os.access(path, os.W_OK):  # root may write what is read-only
        raise PermissionError(EACCES, "it is read-only")


def why_unwritable(path: Path) -> str:
    """Why no file could be written at a path, or in it where it is a folder; "" if one could.

    It is tried: rights alone do not say it of the folders of a system, such as /proc.
    """
    target = folder = real_path(path)
    try:
        if not os.path.isdir(target):
            if os.path.exists(target):
                _check_file(target)
            elif len(os.fsencode(target.name)) > _LONGEST_NAME:
                return f"its name is longer than {_LONGEST_NAME} bytes"
            elif why := why_unreachable(target):
                return why
            folder = target.parent
            while not os.path.exists(folder):
                folder = folder.parent
        if not os.path.isdir(folder):
            return f"{folder} is a file, not a folder"
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        if os.path.exists(path) and not os.path.isdir(path):
            return str(error.strerror)
        return f"no file can be made in {folder} ({error.strerror})"


def _keep(path: Path) -> None:
    """Wait until a file, or the names in a folder, are where a loss of power leaves them."""
    handle = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def called_otherwise(path: Path, suffixes: Collection[str]) -> bool:
    """Whether a name is that of a file of another kind than those with these suffixes: ``plant.csv``, not ``run.2``."""
    suffix = path.suffix.lower()
    return suffix not in suffixes and bool(_OF_A_FILE.fullmatch(suffix))


_IN_ITS_PLACE = {
    ".csv": "; to_pandas() makes a table, which its to_csv(...) writes",
    **dict.fromkeys((".png", ".pdf", ".svg"), "; plot(...) of a result draws it"),
}


def refuse_no_result(path: Path, argument: str) -> None:
    """Refuse to write a result into a file that is called as one of another kind, which it would replace.

    Parameters
    ----------
    path : Path
    argument : str
        By which somebody names it.

    Raises
    ------
    ConfigError
    """
    file = real_path(path) if os.path.islink(path) else path  # what a link points to would be replaced
    if called_otherwise(path, RESULT_SUFFIXES) or called_otherwise(file, RESULT_SUFFIXES):
        kinds = ", ".join(sorted(RESULT_SUFFIXES))
        found = str(path) if file is path else f"{path}, a link to {file}"
        instead = _IN_ITS_PLACE.get(file.suffix.lower(), "")
        raise ConfigError(f"{argument}: expected the name of a file {kinds}, found {found}{instead}")


def refuse_original(path: Path, option: str = "") -> None:
    """Refuse to replace a configuration, a recording or another file that the command reads.

    Parameters
    ----------
    path : Path
    option : str
        By which somebody names it, if one does.

    Raises
    ------
    ConfigError
    """
    if is_original(path):
        named = f"{option}: " if option else ""
        raise ConfigError(f"{named}{path} is read, and would be replaced: name another file or folder")


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with written_whole(path) as part:
        part.write_text(text, encoding="utf-8")


def remove_file(path: Path) -> None:
    """Remove a file, if it is there.

    Raises
    ------
    ConfigError
        When it cannot be removed, as a folder of this name.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot be removed: {error.strerror}", file=str(path)) from None


def remove_leftovers(folder: Path) -> None:
    """Remove what a killed process has left half-written in a folder."""
    if not os.path.isdir(folder):
        return
    for path in folder.glob(".*.part"):
        match = _LEFTOVER.fullmatch(path.name)
        if match and not _alive(int(match[1])):
            path.unlink(missing_ok=True)


def _alive(pid: int) -> bool:
    if os.name != "posix":
        return True  # no harmless question there
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    try:  # a killed process whose parent has not asked for its end is still listed
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0] != b"Z"
    except (OSError, IndexError):
        return True


def json_value(value: Any) -> Any:
    """A value as JSON holds it: numbers that are not finite as text, complex ones as [re, im], arrays as lists."""
    import numpy as np  # not for whoever asks where a path leads

    if isinstance(value, Mapping):
        return {str(key): json_value(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_value(part) for part in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return json_value(value.tolist())
    if isinstance(value, complex):
        return [json_value(value.real), json_value(value.imag)]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
