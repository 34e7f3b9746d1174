"""Digests of what a result file holds: bytes that were lost or changed on a disk or on the way are not read as numbers.

Every data set has an attribute ``sha256``: of its numbers as little-endian bytes, row after row, or of its names, one
a line. The file has one of its attributes and those of its groups. Files of before have none.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256

import h5py
import numpy as np

from hgorun.native.rows import in_one_piece

ATTRIBUTE = "sha256"
_LEFT_OUT = {ATTRIBUTE, "created"}  # equal results are equal files but for the time


def of_numbers(values: np.ndarray) -> str:
    """The digest of an array of numbers, whatever the order of its bytes."""
    return sha256(little(values).data if values.size else b"").hexdigest()


def little(values: np.ndarray) -> np.ndarray:
    """An array as its digest takes it: little-endian, row after row."""
    return np.ascontiguousarray(in_one_piece(values), dtype=values.dtype.newbyteorder("<"))


def of_names(names: Sequence[str]) -> str:
    """The digest of a list of names."""
    return sha256("\n".join(names).encode()).hexdigest()


def of_file(file: h5py.File) -> dict[str, str]:
    """The digests that stand at the data sets of a file, by their paths; those without are left out."""
    found: dict[str, str] = {}

    def add(path: str, link: object) -> None:
        thing = file[path] if isinstance(link, h5py.HardLink) else None  # others could lead elsewhere
        digest = thing.attrs.get(ATTRIBUTE) if isinstance(thing, h5py.Dataset) else None
        if isinstance(digest, str):
            found[path] = digest

    file.visititems_links(add)  # a data set may have several names
    return found


def of_attributes(file: h5py.File) -> str:
    """The digest of all attributes of a file and its groups, but for itself and the time."""
    found = sha256()

    def add(name: str, thing: h5py.Group) -> None:
        for key in sorted(thing.attrs):
            if key not in _LEFT_OUT:
                found.update(f"{name}\n{key}\n{thing.attrs[key]!r}\n".encode(errors="backslashreplace"))

    add("/", file)
    if "plant" in file:
        add("plant", file["plant"])
    for room in ("observers", "metrics"):
        for label in sorted(file.get(room, ())):
            thing = file[room].get(label)
            if isinstance(thing, h5py.Group):
                add(f"{room}/{label}", thing)
    return found.hexdigest()
