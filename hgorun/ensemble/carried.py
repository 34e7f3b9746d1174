"""Members that have been carried out, and the bytes of their file: the same bytes for the same members."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from time import perf_counter
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.block import compute
from hgorun.ensemble.collected import Trajectories
from hgorun.ensemble.found import Block
from hgorun.ensemble.recipe import ensemble_of
from hgorun.ensemble.trajectories import chosen, follow

_BESIDE = ("observers", "states", "metrics")  # fields of a block that are no arrays
_TEXTS = ("reason", "error", "method")


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """The members from ``start`` to before ``stop``.

    Attributes
    ----------
    block : Block
    followed : Trajectories or None
        Trajectories of those that are followed.
    seconds : float
        What it took.
    """

    start: int
    stop: int
    block: Block
    followed: Trajectories | None = None
    seconds: float = 0.0


def carry_out(
    recipe: str, start: int, stop: int, threads: int = 1, progress: Callable[[int], None] | None = None
) -> Carried:
    """Carry members out; the same in any process.

    Parameters
    ----------
    recipe : str
        Of the ensemble, see :func:`hgorun.ensemble.recipe.recipe_of`.
    start, stop : int
        Numbers of the first member and of that behind the last.
    threads : int
        How many carry members out side by side.
    progress : callable, optional
        Called with the number of members that are finished.
    """
    began = perf_counter()
    ensemble = ensemble_of(recipe)
    members = ensemble.members(start, stop)
    block = compute(ensemble.base, members, metrics=ensemble.metrics, threads=threads, progress=progress)
    followed = follow(ensemble, chosen(ensemble.keep.trajectories, start, stop))
    return Carried(start=start, stop=stop, block=block, followed=followed, seconds=perf_counter() - began)


def to_bytes(carried: Carried) -> bytes:
    """The bytes of a block's file."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("v108", "v108")) as file:
        block = carried.block
        file.attrs["start"], file.attrs["stop"] = carried.start, carried.stop
        for name in ("observers", "states"):
            _write_texts(file, name, np.array(getattr(block, name), dtype=object))
        file.create_group("metrics", track_order=True)
        for name, values in block.metrics.items():
            _write(file, f"metrics/{name}", values)
        for name in _arrays():
            (_write_texts if name in _TEXTS else _write)(file, name, getattr(block, name))
        if carried.followed is not None:
            for field in fields(Trajectories):
                _write(file, f"followed/{field.name}", getattr(carried.followed, field.name))
    return buffer.getvalue()


def from_bytes(content: bytes) -> Carried:
    """The members that a file's bytes hold, which are known to be intact."""
    with h5py.File(io.BytesIO(content), "r") as file:
        arrays: dict[str, Any] = {n: (_read_texts if n in _TEXTS else _read)(file, n) for n in _arrays()}
        names: dict[str, Any] = {name: tuple(_read_texts(file, name)) for name in ("observers", "states")}
        metrics: dict[str, Any] = {name: _read(file, f"metrics/{name}") for name in file["metrics"]}
        followed = None
        if "followed" in file:
            kept: dict[str, Any] = {f.name: _read(file, f"followed/{f.name}") for f in fields(Trajectories)}
            followed = Trajectories(**kept)
        start, stop = int(file.attrs["start"]), int(file.attrs["stop"])
    return Carried(start=start, stop=stop, block=Block(**names, metrics=metrics, **arrays), followed=followed)


def _arrays() -> Iterator[str]:
    return (field.name for field in fields(Block) if field.name not in _BESIDE)


def _write(file: h5py.File, name: str, values: NDArray[np.generic]) -> None:
    file.create_dataset(name, data=values, track_times=False)


def _read(file: h5py.File, name: str) -> NDArray[np.generic]:
    return np.asarray(file[name][()])


def _write_texts(file: h5py.File, name: str, values: NDArray[np.object_]) -> None:
    """Texts as a list of those that occur, and their places in it: most of them are equal."""
    known: dict[str, int] = {}
    places = [known.setdefault(text, len(known)) for text in values.ravel().tolist()]
    _write(file, f"{name}/place", np.array(places, dtype=np.int32).reshape(values.shape))
    table = np.array([text.encode() for text in known], dtype=object)
    file.create_dataset(f"{name}/text", data=table, dtype=h5py.string_dtype(), track_times=False)


def _read_texts(file: h5py.File, name: str) -> NDArray[np.object_]:
    table = np.asarray(file[f"{name}/text"].asstr()[()], dtype=object)
    return np.asarray(table[_read(file, f"{name}/place")])
