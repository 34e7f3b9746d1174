"""The bytes of a block's file: the same for the same members, and read as if they came from a stranger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.engine.methods import METHODS
from hgorun.ensemble.blocks.carried import Carried
from hgorun.ensemble.collected.collected import Trajectories
from hgorun.ensemble.collected.trajectories import chosen
from hgorun.ensemble.found import Block
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.errors import ConfigError
from hgorun.result.hdf5.guarded import Failed, guarded
from hgorun.result.hdf5.stored import StoredFile, found
from hgorun.result.records.status import STATUSES

_TEXTS = ("reason", "error", "method")
_SECONDS = 60.0  # that reading a few blocks may take
_ARRAYS = {  # of every member, or of every observer of it: the type; of texts that of their places in a list
    "status": "int8",
    "status_at": "float64",
    "diverged_at": "float64",
    "reason": "int32",
    "plant_status": "int8",
    "error": "int32",
    "method": "int32",
    "step": "float64",
    "rtol": "float64",
    "evaluations": "int64",
    "integration_error": "float64",
    "quantities": "float64",
}
_OF_OBSERVERS = ("status", "status_at", "diverged_at", "reason")


@dataclass(frozen=True)
class Form:
    """What a block has to hold.

    Attributes
    ----------
    path : Path
        Of its file, for messages.
    fingerprint : str
        Of what its numbers follow from.
    start, stop : int
        Its members, from the first to before the last.
    observers, states, metrics : tuple of str
    followed : tuple of int
        Numbers of the members whose trajectories it holds.
    quantities : int
        How many there are besides metrics.
    """

    path: Path
    fingerprint: str
    start: int
    stop: int
    observers: tuple[str, ...]
    states: tuple[str, ...]
    metrics: tuple[str, ...]
    followed: tuple[int, ...]
    quantities: int

    @classmethod
    def of(cls, ensemble: Ensemble, path: Path, fingerprint: str, start: int, stop: int) -> Form:
        """Of a block of an ensemble."""
        return cls(
            path=path,
            fingerprint=fingerprint,
            start=start,
            stop=stop,
            observers=tuple(ensemble.base.observers),
            states=tuple(ensemble.base.plant.model.states),
            metrics=ensemble.metrics,
            followed=tuple(chosen(ensemble.keep.trajectories, start, stop)),
            quantities=len(ensemble.quantities),
        )

    def shape(self, name: str) -> tuple[int, ...]:
        """The shape of an array with a value for every member."""
        size, m = self.stop - self.start, len(self.observers)
        if name == "integration_error":
            return size, 1 + m
        if name == "quantities":
            return size, self.quantities
        return (size, m) if name in _OF_OBSERVERS else (size,)


def to_bytes(carried: Carried, fingerprint: str) -> bytes:
    """The bytes of a block's file.

    Parameters
    ----------
    fingerprint : str
        Of what its numbers follow from.
    """
    buffer = BytesIO()
    with h5py.File(buffer, "w", libver=("v108", "v108")) as file:
        block = carried.block
        file.attrs["fingerprint"] = fingerprint
        file.attrs["start"], file.attrs["stop"] = carried.start, carried.stop
        for name in ("observers", "states"):
            _write_texts(file, name, np.array(getattr(block, name), dtype=object))
        file.create_group("metrics", track_order=True)
        for name, values in block.metrics.items():
            _write(file, f"metrics/{name}", values)
        for name in _ARRAYS:
            (_write_texts if name in _TEXTS else _write)(file, name, getattr(block, name))
        if carried.followed is not None:
            for name in ("member", "time", "x", "xhat"):
                _write(file, f"followed/{name}", getattr(carried.followed, name))
    return buffer.getvalue()


def from_bytes(content: bytes, form: Form) -> Carried:
    """The members that a block's file holds.

    Raises
    ------
    ConfigError
        Where it does not hold what it has to.
    """
    budget = _budget(content)
    return found(BytesIO(content), form.path, budget, lambda file: _Reader(file, form, budget).carried())


def from_files(contents: Sequence[tuple[bytes, Form]]) -> list[Carried]:
    """The members of several files, read in a process of its own: to begin one for every small block would take longer
    than to read it.

    Raises
    ------
    ConfigError
        For the first file that does not hold what it has to.
    """
    memory = 4 * sum(_budget(content) for content, _ in contents) + 2**28
    try:
        return guarded(lambda: [from_bytes(*one) for one in contents], seconds=_SECONDS, memory=memory)
    except Failed as error:
        if len(contents) == 1:
            raise ConfigError(f"not an intact block of a sweep: {error}", file=str(contents[0][1].path)) from None
        return [carried for one in contents for carried in from_files([one])]


def _budget(content: bytes) -> int:
    """Bytes that its numbers may take: they are not compressed, but each counts as 8 bytes."""
    return 8 * len(content) + 2**16


class _Reader(StoredFile):
    """A block's file, piece by piece."""

    def __init__(self, file: h5py.File, form: Form, budget: int) -> None:
        super().__init__(file, form.path, budget)
        self.form = form

    def carried(self) -> Carried:
        form = self.form
        if self.text("fingerprint") != form.fingerprint:
            raise self.error("not a block of this sweep: it has the fingerprint of another one")
        if (self.integer("start"), self.integer("stop")) != (form.start, form.stop):
            raise self.error("its name does not say the members that it holds")
        for name in ("observers", "states"):
            if tuple(self.texts(name, (len(getattr(form, name)),))) != getattr(form, name):
                raise self.error(f"{name} are not those of the sweep")
        shape = form.stop - form.start, len(form.observers), len(form.states)
        metrics = {name: self.exactly(f"metrics/{name}", "float64", shape) for name in form.metrics}
        arrays: dict[str, Any] = {
            name: self.texts(name, form.shape(name)) if name in _TEXTS else self.exactly(name, kind, form.shape(name))
            for name, kind in _ARRAYS.items()
        }
        for name in ("status", "plant_status"):
            if not np.all((arrays[name] >= 0) & (arrays[name] < len(STATUSES))):
                raise self.error(f"{name} holds numbers that are none of {', '.join(STATUSES)}")
        if not {"", *METHODS}.issuperset(arrays["method"].tolist()):
            raise self.error(f"method holds texts that are none of {', '.join(METHODS)}")
        block = Block(observers=form.observers, states=form.states, metrics=metrics, **arrays)
        return Carried(start=form.start, stop=form.stop, block=block, followed=self.followed())

    def followed(self) -> Trajectories | None:
        """The trajectories that it has to hold."""
        form, count = self.form, len(self.form.followed)
        if not count:
            return None
        time = self.times("followed/time")
        m, n = len(form.observers), len(form.states)
        member = self.exactly("followed/member", "int64", (count,))
        if tuple(member.tolist()) != form.followed:
            raise self.error("followed/member are not the members that are followed")
        return Trajectories(
            member=member,
            time=time,
            x=self.exactly("followed/x", "float64", (count, time.size, n)),
            xhat=self.exactly("followed/xhat", "float64", (count, m, time.size, n)),
        )

    def exactly(self, name: str, kind: str, shape: tuple[int, ...]) -> NDArray[Any]:
        """An array of one type and shape."""
        data = self.data(name)
        if data.dtype != np.dtype(kind) or data.shape != shape:
            raise self.error(f"{name} has type {data.dtype} and shape {data.shape}, expected {kind} and {shape}")
        self.take(data.size)
        return np.asarray(data[()])

    def texts(self, name: str, shape: tuple[int, ...]) -> NDArray[np.object_]:
        """Texts by their places in a list."""
        data = self.data(f"{name}/text")
        if h5py.check_string_dtype(data.dtype) is None or data.shape is None or len(data.shape) != 1:
            raise self.error(f"{name}/text must be a list of texts")
        self.take(data.size)
        table = np.asarray(data.asstr()[()], dtype=object)
        places = self.exactly(f"{name}/place", "int32", shape)
        if not np.all((places >= 0) & (places < table.size)):
            raise self.error(f"{name}/place must be places in {name}/text")
        return np.asarray(table[places], dtype=object)

    def take(self, size: int) -> None:
        """Count numbers before they are read."""
        self.budget -= 8 * size
        if self.budget < 0:
            raise self.error("it claims more numbers than its bytes can hold")


def _write(file: h5py.File, name: str, values: NDArray[np.generic]) -> None:
    file.create_dataset(name, data=values, track_times=False)


def _write_texts(file: h5py.File, name: str, values: NDArray[np.object_]) -> None:
    """Texts as a list of those that occur, and their places in it: most of them are equal."""
    known: dict[str, int] = {}
    places = [known.setdefault(text, len(known)) for text in values.ravel().tolist()]
    _write(file, f"{name}/place", np.array(places, dtype=np.int32).reshape(values.shape))
    table = np.array([text.encode() for text in known], dtype=object)
    file.create_dataset(f"{name}/text", data=table, dtype=h5py.string_dtype(), track_times=False)
