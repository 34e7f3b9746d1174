"""Carry an ensemble out: what is missing of it, block by block, and collect its file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hgorun.ensemble.blocks.carried import Carried
from hgorun.ensemble.blocks.cuts import Cuts, Range, most_members
from hgorun.ensemble.collecting import collect, is_collected
from hgorun.ensemble.executors import Executor, threads
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.folder.stored import Damaged
from hgorun.ensemble.found import FAILED
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.errors import ConfigError
from hgorun.files import remove_file
from hgorun.process import processors

SUFFIX = ".sweep"
_AGAIN = 3  # times that damaged blocks are made anew


@dataclass(frozen=True)
class Place:
    """Where an ensemble is kept.

    Attributes
    ----------
    file : Path
        The collected file.
    folder : Path
        The manifest and the blocks.
    """

    file: Path
    folder: Path

    @classmethod
    def of(cls, file: Path) -> Place:
        """Beside a collected file, the folder of the same name."""
        name = file.stem if file.stem.endswith(SUFFIX) else f"{file.stem}{SUFFIX}"
        return cls(file, file.parent / name)


@dataclass(frozen=True)
class Part:
    """One of several equal parts of an ensemble, counted from 1; ``2/8`` as text."""

    number: int
    of: int

    @classmethod
    def read(cls, text: str) -> Part:
        """From text.

        Raises
        ------
        ConfigError
        """
        number, slash, count = text.partition("/")
        if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
            return cls(int(number), int(count))
        raise ConfigError(f"--part: expected k/n with 1 <= k <= n, found {text!r}")

    def range(self, size: int) -> Range:
        """Its members among so many."""
        return size * (self.number - 1) // self.of, size * self.number // self.of


@dataclass
class Count:
    """How far an ensemble is.

    Attributes
    ----------
    members, done, failed : int
        How many there are, how many are finished, and of how many of those, as far as this call has carried them out,
        an estimate has no numbers.
    stored : int
        How many of the finished ones another call finds.
    """

    members: int
    done: int
    failed: int = 0
    stored: int = 0

    def continued(self, name: str, same: str = "the same command") -> str:
        """What is to be said of an ensemble that is interrupted."""
        there = f"{self.stored} of {self.members} members are finished" if self.stored else "no member is finished yet"
        return f"hgorun: {name}: {there}; {same} {'continues there' if self.stored else 'begins again'}"


def carry_out(
    store: Store,
    executor: Executor | None = None,
    *,
    part: Part | None = None,
    workers: int = 1,
    told: Callable[[Count], None] = lambda _: None,
) -> None:
    """Carry out what is missing.

    Parameters
    ----------
    store : Store
    executor : callable, optional
        By default threads, one a processor.
    part : Part, optional
        Only this one.
    workers : int
        Blocks that the executor carries out side by side.
    told : callable
        Told how far it is.

    Raises
    ------
    HgorunError
        When a block cannot be written, or workers cannot be used; what is finished stays.
    """
    start, stop = (0, store.size) if part is None else part.range(store.size)
    gaps = store.missing(start, stop)
    done = stop - start - sum(b - a for a, b in gaps)
    count = Count(stop - start, done, stored=done)
    told(count)
    if not gaps:
        return
    cuts = Cuts(gaps, most_members(store.ensemble), workers)

    def inside(finished: int) -> None:
        told(replace(count, done=count.done + finished))

    for carried in (executor or threads(processors()))(store.recipe, cuts, inside):
        cuts.learn(carried)
        store.write(carried)
        count.done += carried.stop - carried.start
        count.failed += _lost(carried)
        count.stored = count.done
        told(count)


def _lost(carried: Carried) -> int:
    """How many members have an estimate without numbers, or have failed as a whole."""
    diverged = FAILED - 2  # diverged, undefined, failed
    return int(np.count_nonzero((carried.block.status >= diverged).any(axis=1) | (carried.block.error != "")))


def finished(store: Store, file: Path, again: Callable[[], None]) -> bool:
    """Collect the file of an ensemble, if all its members are there.

    Parameters
    ----------
    again : callable
        Carries out what is missing where a block turns out to be damaged.

    Returns
    -------
    bool
        Whether the file is there.
    """
    for attempt in range(_AGAIN):
        if store.missing():
            return False
        if is_collected(store, file):
            return True
        try:
            collect(store, file)
        except Damaged as damaged:
            if attempt == _AGAIN - 1:
                raise
            remove_file(damaged.path)
            again()
    return True


def sweep_to(ensemble: Ensemble, place: Place, *, fresh: bool = False) -> Store:
    """Carry an ensemble out by threads of this process and collect its file."""
    store = Store.opened(place.folder, ensemble, fresh=fresh)
    carry_out(store)
    finished(store, place.file, lambda: carry_out(store))
    return store
