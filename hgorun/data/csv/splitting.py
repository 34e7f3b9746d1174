"""The cells of a line."""

from __future__ import annotations

import csv
import re

SPACES = " "
"""A separator of any number of spaces and tabs."""

_SPACED = re.compile(r'"((?:[^"]|"")*)"(?!\S)|(\S+)')  # cells between spaces


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line; one whose quotes are wrong is split at every separator."""
    if separator == SPACES:
        return _between_spaces(line) if '"' in line else line.split()
    try:
        return next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True), [])
    except csv.Error:
        return line.split(separator)


def _between_spaces(line: str) -> list[str]:
    """The cells between spaces and tabs; those in quotes may hold some. A quote that is left open is any sign."""
    return [plain or quoted.replace('""', '"') for quoted, plain in _SPACED.findall(line)]
