"""The folder in which an ensemble is carried out: a manifest, and a file for every block of members.

No block ever changes. Its file is written whole and then takes its name, which says which members it holds, the
fingerprint of what they follow from, and the hash of its bytes. So whatever is interrupted, and whoever else writes
into the folder, what has a name is finished; what belongs to another configuration is never taken, and what was
damaged later is noticed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hgorun.ensemble.blocks.carried import Carried
from hgorun.ensemble.folder.block_file import Form, from_files, to_bytes
from hgorun.ensemble.folder.manifest import MANIFEST, Manifest
from hgorun.ensemble.folder.stored import Stored, content, digest, together
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.fingerprint import difference
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import remove_file, remove_leftovers, written_whole

COLLECTED = "collected.json"  # what is known of the file that was collected last
_BLOCK = re.compile(r"(\d{10})-(\d{10})-([0-9a-f]{16})-([0-9a-f]{32})\.h5")


class Changed(HgorunError):
    """The folder holds members of something else."""

    exit_code = 2


@dataclass(frozen=True)
class Store:
    """The folder of an ensemble.

    Attributes
    ----------
    folder : Path
    manifest : Manifest
        What its numbers follow from, and the text from which any process makes its members.
    """

    folder: Path
    manifest: Manifest

    @classmethod
    def opened(
        cls, folder: Path, ensemble: Ensemble, *, fresh: bool = False, advice: str = "--fresh starts anew"
    ) -> Store:
        """The folder for an ensemble, made where there is none.

        Titles and comments of the configuration may change: the manifest then takes the new ones.

        Parameters
        ----------
        fresh : bool
            Begin anew, whatever it holds.
        advice : str
            What to do where it holds members of something else.

        Raises
        ------
        Changed
            When it holds members of another configuration, or of another version of the program, or its manifest is
            none.
        """
        manifest = Manifest.of(ensemble)
        if fresh:
            remove(folder)
        for part in (folder, folder / "blocks"):
            remove_leftovers(part)
        before = None
        if os.path.exists(folder / MANIFEST):
            try:
                before = Manifest.read(folder)
                cls(folder, before).refuse_changes(manifest, f"; {advice}")
                before.refuse_members(manifest.members, folder)
            except ConfigError as error:
                raise Changed(f"{error}; {advice}") from None
        if before != manifest:
            manifest.write(folder)
        return cls(folder, manifest)

    @classmethod
    def existing(cls, folder: Path) -> Store:
        """The store in a folder.

        Raises
        ------
        ConfigError
            When there is none, or its manifest cannot be used.
        """
        store = cls(folder, Manifest.read(folder))
        _ = store.ensemble  # is refused here, if it is
        return store

    def refuse_changes(self, now: Manifest, advice: str = "") -> None:
        """Refuse to be continued as something else, or to be put together with members of it.

        Raises
        ------
        Changed
            With what differs.
        """
        if self.manifest.fingerprint != now.fingerprint:
            changed = difference(self.manifest.made_of, now.made_of)
            raise Changed(f"{self.folder}: holds members of something else: {changed}{advice}")

    def refuse_replaced(self) -> None:
        """Refuse to go on where another command has begun the folder anew, as something else."""
        try:
            now = Manifest.read(self.folder)
        except ConfigError:
            return  # it is being written; what is ours is known by its fingerprint
        if now.fingerprint != self.manifest.fingerprint:
            raise Changed(f"{self.folder}: another command has begun it anew with something else")

    @property
    def recipe(self) -> str:
        """The text that the ensemble is made from."""
        return self.manifest.recipe

    @cached_property
    def ensemble(self) -> Ensemble:
        """The ensemble."""
        return self.manifest.ensemble(self.folder)

    @property
    def size(self) -> int:
        """How many members there are."""
        return self.manifest.members

    def stored(self) -> list[Stored]:
        """The blocks that are finished, by their first members; some may share members.

        Raises
        ------
        ConfigError
            For a block of members that there are not.
        """
        found = []
        blocks = self.folder / "blocks"
        for path in blocks.iterdir() if os.path.isdir(blocks) else ():
            match = _BLOCK.fullmatch(path.name)
            if match and match[3] == self._mark:
                start, stop = int(match[1]), int(match[2])
                if not start < stop <= self.size:
                    raise ConfigError(f"not a block of this sweep, which has {self.size} members", file=str(path))
                found.append(Stored(start, stop, match[4], path))
        return sorted(found, key=lambda one: (one.start, -one.stop, one.digest))

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
        Changed
            When another command has begun the folder anew, as something else.
        HgorunError
            When it cannot be written.
        """
        self.refuse_replaced()
        data = to_bytes(carried, self.manifest.fingerprint)
        name = f"{carried.start:010d}-{carried.stop:010d}-{self._mark}-{digest(data)}.h5"
        with written_whole(self.folder / "blocks" / name) as part:
            part.write_bytes(data)

    def adopt(self, other: Store) -> None:
        """Take over the blocks of another folder of the same ensemble, in place of own ones that are damaged.

        Raises
        ------
        Damaged
            When one of them does not have the bytes that were written.
        ConfigError
            When one of them is no block of this ensemble.
        """
        for several in together(one for one in other.stored() if not self._has(one)):
            other.read(*several)  # nothing is taken that could not be used
            for one in several:
                with written_whole(self.folder / "blocks" / one.path.name) as part:
                    part.write_bytes(content(one))

    def _has(self, one: Stored) -> bool:
        """Whether there is the same block, undamaged."""
        own = self.folder / "blocks" / one.path.name
        return os.path.isfile(own) and digest(own.read_bytes()) == one.digest

    def read(self, *several: Stored) -> list[Carried]:
        """The members of blocks.

        Raises
        ------
        Damaged
            When the bytes of one are not those that were written.
        ConfigError
            When one of them, though it has these bytes, is no block of this sweep.
        """
        mark = self.manifest.fingerprint
        forms = (Form.of(self.ensemble, one.path, mark, one.start, one.stop) for one in several)
        return from_files([(content(one), form) for one, form in zip(several, forms, strict=True)])

    def blocks(self) -> Iterator[tuple[Carried, slice]]:
        """The blocks one by one, each with those of its members that no earlier one holds."""
        at, points = 0, None
        for several in together(self._needed()):
            for one, carried in zip(several, self.read(*several), strict=True):
                if carried.followed is not None:
                    points = points or carried.followed.time.size
                    if carried.followed.time.size != points:
                        raise ConfigError("its trajectories have other times than those before", file=str(one.path))
                yield carried, slice(max(at, one.start) - one.start, one.stop - one.start)
                at = one.stop

    def _needed(self) -> Iterator[Stored]:
        """The blocks that hold members which no earlier one holds."""
        at = 0
        for one in self.stored():
            if one.stop > at:
                at = one.stop
                yield one

    @property
    def _mark(self) -> str:
        """The fingerprint as names of blocks have it."""
        return self.manifest.fingerprint[:16]


def remove(folder: Path) -> None:
    """Remove what a store has put into its folder, and nothing else: its manifest last, without which nobody would know
    what the blocks are.

    Raises
    ------
    ConfigError
        When something cannot be removed.
    """
    blocks = sorted(path for path in (folder / "blocks").glob("*.h5") if _BLOCK.fullmatch(path.name))
    for path in (*blocks, folder / COLLECTED, folder / MANIFEST):
        remove_file(path)
