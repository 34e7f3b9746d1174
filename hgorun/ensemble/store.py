"""The folder in which an ensemble is carried out: a manifest, and a file for every block of members.

Nothing in it ever changes. A block's file is written whole and then takes its name, which says which members it holds
and what the hash of its bytes is. So whatever is interrupted, and whoever else writes into the folder, what has a name
is finished, and what was damaged later is noticed.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from hgorun.ensemble.carried import Carried, from_bytes, to_bytes
from hgorun.ensemble.ensemble import Ensemble
from hgorun.ensemble.fingerprint import Ingredients, difference, fingerprint, ingredients
from hgorun.ensemble.recipe import ensemble_of, recipe_of
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import remove_leftovers, write_text, written_whole

MANIFEST = "manifest.json"
_FORMAT = "hgorun-sweep-store-1"
_BLOCK = re.compile(r"(\d{10})-(\d{10})-([0-9a-f]{32})\.h5")


class Damaged(HgorunError):
    """A block's file does not have the bytes that it was written with; it has been removed."""


class Changed(HgorunError):
    """The folder holds members of something else."""

    exit_code = 2


@dataclass(frozen=True)
class Stored:
    """A block's file: the members from ``start`` to before ``stop``."""

    start: int
    stop: int
    path: Path


@dataclass(frozen=True)
class Store:
    """The folder of an ensemble.

    Attributes
    ----------
    folder : Path
    manifest : dict
        What its numbers follow from, and the text from which any process makes its members.
    """

    folder: Path
    manifest: dict[str, Any]

    @classmethod
    def opened(cls, folder: Path, ensemble: Ensemble, *, fresh: bool = False) -> Store:
        """The folder for an ensemble, made where there is none.

        Parameters
        ----------
        fresh : bool
            Begin anew, whatever it holds.

        Raises
        ------
        Changed
            When it holds members of another configuration, or of another version of the program.
        """
        made_of = ingredients(ensemble)
        if fresh:
            remove(folder)
        for part in (folder, folder / "blocks"):
            remove_leftovers(part)
        if (folder / MANIFEST).exists():
            store = cls.existing(folder)
            store.refuse_changes(made_of, "; --fresh starts anew")
            return store
        manifest = {
            "format": _FORMAT,
            "fingerprint": fingerprint(made_of),
            "members": ensemble.size,
            "made_of": made_of,
            "recipe": recipe_of(ensemble),
        }
        write_text(folder / MANIFEST, json.dumps(manifest, indent=1))
        return cls(folder, manifest)

    @classmethod
    def existing(cls, folder: Path) -> Store:
        """The store in a folder.

        Raises
        ------
        ConfigError
            When there is none, or its manifest cannot be read.
        """
        path = folder / MANIFEST
        try:
            manifest = json.loads(path.read_text(encoding="utf-8"))
            known = manifest["format"] == _FORMAT and isinstance(manifest["recipe"], str)
            known = known and isinstance(manifest["made_of"], dict) and isinstance(manifest["members"], int)
        except FileNotFoundError:
            raise ConfigError(f"no folder of a sweep: {MANIFEST} is missing", file=str(folder)) from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ConfigError(f"not the manifest of a sweep: {error}", file=str(path)) from None
        if not known:
            raise ConfigError("not the manifest of a sweep that this version can continue", file=str(path))
        return cls(folder, manifest)

    def refuse_changes(self, made_of: Ingredients, advice: str = "") -> None:
        """Refuse to be continued with other ingredients, or to be put together with members made of them.

        Raises
        ------
        Changed
            With what differs.
        """
        changed = difference(self.manifest["made_of"], made_of)
        if changed is not None:
            raise Changed(f"{self.folder}: holds members of something else: {changed}{advice}")

    @property
    def recipe(self) -> str:
        """The text that the ensemble is made from."""
        return str(self.manifest["recipe"])

    @cached_property
    def ensemble(self) -> Ensemble:
        """The ensemble."""
        return ensemble_of(self.recipe)

    @property
    def size(self) -> int:
        """How many members there are."""
        return int(self.manifest["members"])

    def stored(self) -> list[Stored]:
        """The blocks that are finished, by their first members; some may share members."""
        found = []
        blocks = self.folder / "blocks"
        for path in blocks.iterdir() if blocks.is_dir() else ():
            if match := _BLOCK.fullmatch(path.name):
                found.append(Stored(int(match[1]), int(match[2]), path))
        return sorted(found, key=lambda one: (one.start, -one.stop))

    def missing(self, start: int = 0, stop: int | None = None) -> list[tuple[int, int]]:
        """Ranges of members that are not there, among those from ``start`` to before ``stop``."""
        gaps, at, end = [], start, self.size if stop is None else stop
        for one in self.stored():
            if one.start > at:
                gaps.append((at, min(one.start, end)))
            at = max(at, one.stop)
            if at >= end:
                break
        return [*(gap for gap in gaps if gap[0] < gap[1]), *([(at, end)] if at < end else [])]

    def write(self, carried: Carried) -> None:
        """Add a block.

        Raises
        ------
        HgorunError
            When it cannot be written.
        """
        content = to_bytes(carried)
        name = f"{carried.start:010d}-{carried.stop:010d}-{hashlib.sha256(content).hexdigest()[:32]}.h5"
        with written_whole(self.folder / "blocks" / name) as part:
            part.write_bytes(content)

    def adopt(self, other: Store) -> None:
        """Take over the blocks of another folder of the same ensemble.

        Raises
        ------
        Damaged
            When one of them does not have the bytes that were written.
        """
        own = {one.path.name for one in self.stored()}
        for one in other.stored():
            if one.path.name not in own:
                content = other.content(one)
                with written_whole(self.folder / "blocks" / one.path.name) as part:
                    part.write_bytes(content)

    def content(self, one: Stored) -> bytes:
        """The bytes of a block's file; see :meth:`read`."""
        content = one.path.read_bytes()
        if hashlib.sha256(content).hexdigest()[:32] != one.path.stem.rpartition("-")[2]:
            one.path.unlink(missing_ok=True)
            raise Damaged(f"{one.path}: damaged, and removed; run the sweep again to make it anew")
        return content

    def read(self, one: Stored) -> Carried:
        """The members of a block.

        Raises
        ------
        Damaged
            When its bytes are not those that were written.
        """
        return from_bytes(self.content(one))

    def blocks(self) -> Iterator[tuple[Carried, slice]]:
        """The blocks one by one, each with those of its members that no earlier one holds."""
        at = 0
        for one in self.stored():
            if one.stop > at:
                yield self.read(one), slice(max(at, one.start) - one.start, one.stop - one.start)
                at = one.stop


def remove(folder: Path) -> None:
    """Remove what a store has put into its folder, and nothing else."""
    for path in [folder / MANIFEST, *(p for p in (folder / "blocks").glob("*.h5") if _BLOCK.fullmatch(p.name))]:
        path.unlink(missing_ok=True)
