"""What kind of file something is, by what it begins with."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from hgorun.errors import ConfigError

HEAD = 4096  # bytes of a file that are looked at
_ROWS = 4  # of a text
_NUMBER = re.compile(r"[-+]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][-+]?[0-9]+)?|nan|NaN")
MEASUREMENTS = "measurements are read from CSV, Parquet, HDF5 and netCDF-4 files"


@dataclass(frozen=True)
class Kind:
    """A kind of file that is no text.

    Attributes
    ----------
    what : str
    instead : str
        What has to be done with it where it holds measurements.
    """

    what: str
    instead: str = MEASUREMENTS


HDF5 = Kind("an HDF5 file", "")
PARQUET = Kind("a Parquet table", "")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ZIP = b"PK\x03\x04"
_BLOCKS = 0, 512, 1024, 2048  # where it may stand: before it there is room for others, such as MATLAB 7.3
_MARKS = {
    b"PAR1": PARQUET,
    _ZIP: Kind("a ZIP archive or a workbook of Excel", "save the sheet as CSV"),
    b"\xd0\xcf\x11\xe0": Kind("an old workbook of Excel", "save the sheet as CSV"),
    b"\x1f\x8b": Kind("compressed by gzip", "unpack it first"),
    b"BZh": Kind("compressed by bzip2", "unpack it first"),
    b"\xfd7zXZ": Kind("compressed by xz", "unpack it first"),
    b"\x28\xb5\x2f\xfd": Kind("compressed by zstd", "unpack it first"),
    **{
        b"CDF" + bytes((version,)): Kind("netCDF of the old kind", "nccopy -k nc4 makes one that is read")
        for version in (1, 2, 5)
    },
    b"MATLAB 5.0 MAT": Kind(
        "a file of MATLAB (.mat) that is not HDF5",
        "save(FILE, '-struct', 'S', '-v7.3') of MATLAB makes one that is read, and writetable or writematrix write CSV",
    ),
    b"MATLAB 7.3 MAT": Kind("a file of MATLAB (.mat) that is cut off", "copy it again"),
    b"\x93NUMPY": Kind("an array of NumPy (.npy)", "numpy.savetxt writes CSV"),
    **{
        bytes((0x80, version)): Kind("a pickle of Python", "write the numbers as CSV, since a pickle could run code")
        for version in range(2, 6)
    },
    b"ARROW1": Kind("a Feather table", "write it as Parquet or CSV"),
    b"SQLite format 3": Kind("an SQLite database", "write the table as CSV"),
    b"\x89PNG": Kind("a picture (PNG)"),
    b"\xff\xd8\xff": Kind("a picture (JPEG)"),
    b"GIF8": Kind("a picture (GIF)"),
    b"%PDF": Kind("a PDF"),
    b"\x7fELF": Kind("a program"),
}
_IN_ZIP = {  # names of files that are the first in an archive
    b".npy": Kind("arrays of NumPy (.npz), as a checkpoint of a stream is", "numpy.savetxt writes CSV"),
    b"modelDescription.xml": Kind("a functional mock-up unit (FMU), which a simulator loads"),
}
_TEXTS = {  # that are for other programs, by the suffixes of their names
    ".py": Kind("a program of Python", "python {} runs it"),
    ".ipynb": Kind("a notebook", "jupyter notebook {} opens it"),
    ".m": Kind("a program of MATLAB", "hgorun has its own equations: hgorun init --plant NAME writes a first one"),
    **dict.fromkeys((".md", ".rst"), Kind("a page to read", "hgorun init copies an example to start from")),
    **dict.fromkeys((".htm", ".html", ".svg"), Kind("a page or a picture", "a browser opens it")),
    **dict.fromkeys((".c", ".h"), Kind("a program in C", "hgorun export CONFIG writes such files")),
    ".tex": Kind("a text in LaTeX", "hgorun export CONFIG writes such files"),
    ".toml": Kind("a TOML file", "hgorun init copies an example in YAML to start from"),
}


def kind_of(head: bytes) -> Kind | None:
    """What begins with these bytes; None for text, and for what is not known."""
    if any(head.startswith(_HDF5, place) for place in _BLOCKS):
        return HDF5
    if head.startswith(_ZIP) and (within := next((kind for mark, kind in _IN_ZIP.items() if mark in head), None)):
        return within
    found = next((kind for mark, kind in _MARKS.items() if head.startswith(mark)), None)
    return None if found is PARQUET and _is_text(head) else found


def _is_text(head: bytes) -> bool:
    """Whether it has no characters that only numbers in other files look like; those follow PAR1 in all of Parquet."""
    return not any(byte < 32 and byte not in b"\t\n\v\f\r\x1a" for byte in head)


def kind_of_file(path: Path) -> Kind | None:
    """What a file is; None for text, for what is not known, and where no file can be read."""
    return kind_of(head_of(path))


def head_of(path: Path) -> bytes:
    """How a file begins; nothing where it cannot be read, and of a pipe, whose first bytes would be lost."""
    if not os.path.isfile(path):  # of a name that is too long, too, there is none
        return b""
    try:
        with path.open("rb") as stream:
            return stream.read(HEAD)
    except OSError:
        return b""  # whoever reads it says why


def is_recording(head: bytes, path: Path) -> bool:
    """Whether what begins so is a table of measurements, by itself or by the suffix of its name."""
    kind = kind_of(head)
    return kind is PARQUET or (kind is None and (path.suffix.lower() in (".csv", ".tsv") or _is_table(head)))


def _is_table(head: bytes) -> bool:
    """Whether it begins as a table of numbers does: lines with as many cells, of which one is all numbers."""
    lines = [line for line in head[:HEAD].decode("utf-8", "replace").splitlines()[:_ROWS] if line.strip()]
    for separator in ",;\t":
        rows = [line.split(separator) for line in lines]
        if len({len(row) for row in rows}) == 1 and len(rows[0]) > 1 and any(all(map(_is_number, row)) for row in rows):
            return True
    return False


def _is_number(cell: str) -> bool:
    """With a point or a comma, in quotes or without."""
    return _NUMBER.fullmatch(cell.strip().strip('"')) is not None


def refuse_what_is_no_text(head: bytes, path: Path) -> None:
    """Refuse in the place of a configuration what begins as a recording or as another kind of file.

    Raises
    ------
    ConfigError
        It says what the file is, and what reads it.
    """
    kind, file = kind_of(head), str(path)
    if is_recording(head, path):
        raise ConfigError(
            f"this is a log, not a configuration: hgorun estimate CONFIG {path} runs observers on it", file=file
        )
    if kind is HDF5:
        advice = f": hgorun compare {path} shows a result, hgorun estimate CONFIG {path} reads a recording"
    elif kind is not None and kind.instead != MEASUREMENTS:
        advice = f"; if it holds measurements: {kind.instead}"
    else:
        advice = "; a YAML file was expected"
    if kind is not None:
        raise ConfigError(f"this is {kind.what}, not a configuration{advice}", file=file)
    if text := _TEXTS.get(path.suffix.lower()):
        raise ConfigError(f"this is {text.what}, not a configuration: {text.instead.format(path)}", file=file)


_FILES = {  # of other commands, by their keys: what they are, and what is done with them
    "sweep": ({"base", "axes"}, "a sweep file", "carries it out"),
    "tune": ({"base", "tune"}, "a file that asks for the gains of another one", "finds them"),
    "benchmark": ({"plants", "scenarios"}, "the file of a benchmark", "carries it out"),
}


def of_another_command(data: object) -> tuple[str, str, str] | None:
    """The command that takes a YAML file with such keys, what the file is, and what the command does with it.

    None for a configuration.

    Parameters
    ----------
    data : object
        What the file says.
    """
    for command, (keys, what, does) in _FILES.items():
        if isinstance(data, dict) and keys <= data.keys():
            return command, what, does
    return None


def refuse_file_of_another_command(data: object, path: Path, command: str = "") -> None:
    """Refuse a YAML file with the keys of one that another command takes.

    Parameters
    ----------
    data : object
        What it says.
    path : Path
    command : str
        The one that it is given to, where that takes such files.

    Raises
    ------
    ConfigError
    """
    found = of_another_command(data)
    if found is not None and found[0] != command:
        name, what, does = found
        raise ConfigError(f"this is {what}; hgorun {name} {path} {does}", file=str(path))
