"""The folder in which an ensemble is carried out: a manifest, and a file for every block of members.

No block ever changes. Its file is written whole and then takes its name, which says which members it holds, the
fingerprint of what they follow from, and the hash of its bytes. So whatever is interrupted, and whoever else writes
into the folder, what has a name is finished; what belongs to another configuration is never taken, and what was
damaged later is noticed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hgorun.ensemble.block_file import Form, from_files, to_bytes
from hgorun.ensemble.carried import Carried
from hgorun.ensemble.ensemble import Ensemble
from hgorun.ensemble.fingerprint import difference
from hgorun.ensemble.manifest import MANIFEST, Manifest
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import remove_leftovers, written_whole

COLLECTED = "collected.json"  # what is known of the file that was collected last
_BLOCK = re.compile(r"(\d{10})-(\d{10})-([0-9a-f]{16})-([0-9a-f]{32})\.h5")
_TOGETHER = 64  # blocks, or
_BYTES = 2**24  # of them, that are read by one process


class Damaged(HgorunError):
    """A block's file does not have the bytes that it was written with.

    Attributes
    ----------
    path : Path
    """

    exit_code = 2

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path}: the block is damaged; run the sweep again to make it anew")
        self.path = path


class Changed(HgorunError):
    """The folder holds members of something else."""

    exit_code = 2


@dataclass(frozen=True)
class Stored:
    """A block's file: the members from ``start`` to before ``stop``, and the hash of its bytes."""

    start: int
    stop: int
    digest: str
    path: Path


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
            When it holds members of another configuration, or of another version of the program.
        ConfigError
            When its manifest is none.
        """
        manifest = Manifest.of(ensemble)
        if fresh:
            remove(folder)
        for part in (folder, folder / "blocks"):
            remove_leftovers(part)
        before = Manifest.read(folder) if (folder / MANIFEST).exists() else None
        if before is not None:
            cls(folder, before).refuse_changes(manifest, f"; {advice}")
            before.refuse_members(manifest.members, folder)
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
        for path in blocks.iterdir() if blocks.is_dir() else ():
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
        content = to_bytes(carried, self.manifest.fingerprint)
        name = f"{carried.start:010d}-{carried.stop:010d}-{self._mark}-{_digest(content)}.h5"
        with written_whole(self.folder / "blocks" / name) as part:
            part.write_bytes(content)

    def adopt(self, other: Store) -> None:
        """Take over the blocks of another folder of the same ensemble, in place of own ones that are damaged.

        Raises
        ------
        Damaged
            When one of them does not have the bytes that were written.
        """
        for one in other.stored():
            own = self.folder / "blocks" / one.path.name
            if own.is_file() and _digest(own.read_bytes()) == one.digest:
                continue
            content = _content(one)
            with written_whole(own) as part:
                part.write_bytes(content)

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
        return from_files([(_content(one), form) for one, form in zip(several, forms, strict=True)])

    def blocks(self) -> Iterator[tuple[Carried, slice]]:
        """The blocks one by one, each with those of its members that no earlier one holds."""
        at, points = 0, None
        for several in self._batches():
            for one, carried in zip(several, self.read(*several), strict=True):
                if carried.followed is not None:
                    points = points or carried.followed.time.size
                    if carried.followed.time.size != points:
                        raise ConfigError("its trajectories have other times than those before", file=str(one.path))
                yield carried, slice(max(at, one.start) - one.start, one.stop - one.start)
                at = one.stop

    def _batches(self) -> Iterator[list[Stored]]:
        """Blocks that are needed, as many together as are read by one process."""
        at, size, waiting = 0, 0, list[Stored]()
        for one in self.stored():
            if one.stop > at:
                at = one.stop
                waiting.append(one)
                size += one.path.stat().st_size if one.path.is_file() else 0
            if len(waiting) == _TOGETHER or size > _BYTES:
                yield waiting
                size, waiting = 0, []
        if waiting:
            yield waiting

    @property
    def _mark(self) -> str:
        """The fingerprint as names of blocks have it."""
        return self.manifest.fingerprint[:16]


def _digest(content: bytes) -> str:
    """The hash of a block's bytes, as its name has it."""
    return hashlib.sha256(content).hexdigest()[:32]


def _content(one: Stored) -> bytes:
    """The bytes of a block's file."""
    try:
        content = one.path.read_bytes()
    except FileNotFoundError:
        raise Damaged(one.path) from None
    except OSError as error:
        raise ConfigError(f"the block cannot be read: {error.strerror}", file=str(one.path)) from None
    if _digest(content) != one.digest:
        raise Damaged(one.path)
    return content


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
