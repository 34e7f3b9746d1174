"""The structure that holds all that an exported observer knows, and its size."""

from __future__ import annotations

from dataclasses import dataclass

from hgorun.export.c_source import Source
from hgorun.export.names import plain
from hgorun.export.observer import Exported


@dataclass(frozen=True)
class Member:
    """A member of the structure that holds all of an observer.

    Attributes
    ----------
    type, name : str
    size, align : int
        Bytes of one entry, and what its address is a multiple of.
    count : int
        0: no array.
    meaning : str
    """

    type: str
    name: str
    size: int
    align: int
    count: int = 0
    meaning: str = ""

    def __str__(self) -> str:
        array = f"[{self.count}]" if self.count else ""
        return f"    {self.type} {self.name}{array};" + (f" /* {self.meaning} */" if self.meaning else "")


def members(source: Source) -> list[Member]:
    """All that an observer knows."""
    observer, p, real = source.observer, source.prefix, source.real.name
    q, m, late, r = (
        len(observer.outputs),
        len(observer.inputs),
        len(observer.remembered),
        4 if source.real.single else 8,
    )

    def reals(name: str, count: int, meaning: str = "") -> Member:
        return Member(real, name, r, r, count, meaning)

    line = _padded(16 + 3 * r)
    found = [Member("double", "t", 8, 8, meaning="now"), reals("z", observer.size, plain(_layout(observer)))]
    if observer.sampled:
        found += [reals("y", q, "the last samples, and when they were taken"), Member("double", "taken", 8, 8, q)]
        found += [reals("s", q, "C xhat - alpha at that time")] if observer.compares else []
    if observer.compares:
        found += [Member("uint32_t", "mode", 4, 4, q)]
    if observer.continuous:
        found += [Member(f"{p}line", "line", line, 8, q)]
    if observer.inputs:
        found += [Member(f"{p}line", "input", line, 8, m)]
    if observer.clocks:
        found += [Member("double", "sampled", 8, 8, meaning="the time of the last sample, if there was one")]
        found += [Member("uint32_t", "samples", 4, 4)]
        found += [reals("before", m)] if m and not observer.corrected else []
    if observer.joins:
        found += [reals("before", observer.size, "z without the samples that were taken last")]
        found += [Member("double", "joined", 8, 8, meaning="when these were taken")]
        found += [Member("uint32_t", "which", 4, 4, meaning="a bit for each of their outputs")]
    if observer.pieces:
        found += [Member("uint32_t", "pieces", 4, 4), Member("uint32_t", "newest", 4, 4), reals("first", late)]
        found += [Member(f"{p}piece", "past", _padded(16 + 4 * r * late), 8, observer.pieces)]
    return found


def _padded(size: int) -> int:
    return -(-size // 8) * 8


def bytes_of(source: Source) -> int:
    """The size of the observer's memory, where a double lies at multiples of 8 bytes."""
    at = 0
    for member in members(source):
        at = -(-at // member.align) * member.align + member.size * max(member.count, 1)
    return _padded(at)


def _layout(observer: Exported) -> str:
    parts = [f"{name} from {state.start}" for name, state in observer.block.states.items()]
    return ", ".join(parts)
