"""A collected file read back, which may come from anybody."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, Trajectories, last_point
from hgorun.errors import printable
from hgorun.result.hdf5.forms import SWEEP, form_of, not_this
from hgorun.result.hdf5.not_yet import refuse_what_has_not_run
from hgorun.result.hdf5.stored import LARGEST, NAMED, StoredFile, budget_of, file_at, opened
from hgorun.result.records.status import STATUSES

QUANTITIES = "quantities"


def is_sweep(path: Path) -> bool:
    """Whether it is a collected file, or the folder in which one is made."""
    if os.path.isdir(path):
        return os.path.isfile(path / "manifest.json")
    return form_of(path) == SWEEP


def read(path: str | Path, *, max_memory: float = LARGEST) -> Collected:
    """Read a collected file.

    Parameters
    ----------
    path : path
    max_memory : float
        Bytes that its numbers may take; 1 GiB by default, ``inf`` for any.

    Raises
    ------
    ConfigError
        When the file is missing, not one of an ensemble, damaged, or larger than allowed.
    """
    path = file_at(path)
    refuse_what_has_not_run(path, SWEEP)
    budget = budget_of(max_memory)
    return opened(path, budget, lambda file: _Reader(file, path, budget).collected())


def base_of(path: Path) -> str:
    """The configuration that members vary, as YAML, as a collected file holds it.

    Raises
    ------
    ConfigError
        When the file is missing, damaged, or does not hold it.
    """
    path = file_at(path)
    return opened(path, LARGEST, lambda file: StoredFile(file, path, LARGEST).text("config_resolved"))


class _Reader(StoredFile):
    """A collected file, piece by piece."""

    def collected(self) -> Collected:
        form = self.file.attrs.get("format")
        if not isinstance(form, str) or form != SWEEP:
            raise self.error(not_this(form, SWEEP, self.path))
        observers, states = self.words("observer"), self.words("state")
        *dimensions, last = self.dimensions("status") or [""]
        if last != "observer":
            raise self.error("status is missing, or its last dimension is not observer")
        shape = tuple(self.data(name).shape[0] for name in dimensions)
        size, m, n = int(np.prod(shape, dtype=np.int64)), len(observers), len(states)
        metrics = {}
        for name in self.file:
            if self.dimensions(name) == [*dimensions, "observer", "state"]:
                metrics[printable(name)] = self.numbers(name, *shape, m, n).reshape(size, m, n)
        status = self.numbers("status", *shape, m).reshape(size, m)
        if not np.all(np.isin(status, np.arange(len(STATUSES)))):
            raise self.error(f"status holds numbers that are none of {', '.join(STATUSES)}")
        error = np.array(self.texts("error", *shape), dtype=object) if "error" in self.file else np.full(size, "", "O")
        axes = self.axes(dimensions, shape)
        return Collected(
            name=printable(self.text("name")) if "name" in self.file.attrs else self.path.name.partition(".")[0],
            title=printable(self.text("title")) if "title" in self.file.attrs else "",
            axes=axes,
            observers=observers,
            states=states,
            metrics=metrics,
            status=status.astype(np.int8),
            error=error,
            units=self.entries("units", lambda _, v: isinstance(v, str), "text") if "units" in self.file.attrs else {},
            random=self.random_axes(),
            families=self.families(observers),
            dimensions=dict(zip(dimensions, shape, strict=True)),
            planned=size,
            trajectories=self.trajectories(size, m, n) if "trajectories" in self.file else None,
            quantities=self.quantities(dimensions, shape),
            settling=self.settling(),
            end=self.end(axes),
            integration_error=self.integration_error(shape, size, m),
        )

    def integration_error(self, shape: tuple[int, ...], size: int, m: int) -> Floats:
        """Of the plant and of the observers; no rows where the file has none."""
        names = "plant_integration_error", "integration_error"
        if not all(name in self.file for name in names):
            return np.empty((0, 0))
        plant, own = self.numbers(names[0], *shape), self.numbers(names[1], *shape, m)
        return np.concatenate([plant.reshape(size, 1), own.reshape(size, m)], axis=1)

    def settling(self) -> float:
        """The part of the peak in the configuration of its base."""
        return self.number_of_base("metrics", "settling", 0.05)

    def end(self, axes: Iterable[str]) -> float:
        """The last output point of its members."""
        if any(path.startswith("time.") for path in axes):
            return math.inf
        start, end, step = (self.number_of_base("time", key, 0.0) for key in ("start", "end", "output_step"))
        return last_point(start, end, step) if end > start and step > 0 else math.inf

    def number_of_base(self, block: str, key: str, default: float) -> float:
        """A number in the configuration of its base."""
        text = self.text("config_resolved") if "config_resolved" in self.file.attrs else ""
        found = re.search(rf"^{block}:\n(?:[ ]+.*\n)*?[ ]+{key}: (-?[0-9.]+(?:e[+-]?[0-9]+)?)$", text, re.MULTILINE)
        return float(found[1]) if found else default

    def quantities(self, dimensions: Sequence[str], shape: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        """What else was measured; nothing in most files."""
        if self.dimensions(QUANTITIES) != [*dimensions, "quantity"]:
            return {}
        names = self.texts("quantity", *(self.data("quantity").shape or (0,)))
        values = self.numbers(QUANTITIES, *shape, len(names)).reshape(-1, len(names))
        return dict(zip(names, values.T, strict=True))

    def axes(self, dimensions: Sequence[str], shape: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        """The values of every axis for every member: of a product from its dimensions, else from coordinates."""
        if list(dimensions) == ["member"]:
            return {name: self.values(name, *shape) for name in self.labels_of_file("axes")}
        own = [self.values(name, size) for name, size in zip(dimensions, shape, strict=True)]
        places = np.indices(shape).reshape(len(shape), -1)
        return {name: values[place] for name, values, place in zip(dimensions, own, places, strict=True)}

    def random_axes(self) -> frozenset[str]:
        """Axes of random draws, as the sweep is described in the file; none where it is not."""
        try:
            axes = json.loads(self.text("sweep"))["axes"] if "sweep" in self.file.attrs else {}
            return frozenset(path for path, values in axes.items() if isinstance(values, dict) and "draws" in values)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise self.error("attribute sweep does not describe a sweep") from None

    def labels_of_file(self, attribute: str) -> list[str]:
        """Names in an attribute of the file."""
        found = np.atleast_1d(self.file.attrs.get(attribute, np.empty(0, dtype=object)))
        if not all(isinstance(name, str) for name in found):
            raise self.error(f"attribute {attribute} must be a list of names")
        return [str(name) for name in found]

    def dimensions(self, name: str) -> list[str]:
        """What the dimensions of a data set are called; nothing for a group."""
        link = self.file.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink) or not isinstance(self.file[name], h5py.Dataset):
            return []
        data = self.data(name)
        if data.is_scale:
            return [name] if data.shape is not None and len(data.shape) == 1 else []
        return [dim[0].name.lstrip("/") if len(dim) else "" for dim in data.dims]

    def values(self, name: str, size: int) -> NDArray[Any]:
        """Numbers or texts."""
        if self.data(name).dtype.kind in "iu":
            return self.integers(name, size)
        return self.numbers(name, size) if self.data(name).dtype.kind == "f" else np.array(self.texts(name, size), "O")

    def texts(self, name: str, *shape: int) -> list[str]:
        """Texts of a data set, row after row."""
        data = self.data(name)
        if h5py.check_string_dtype(data.dtype) is None or data.shape != shape:
            raise self.error(f"{name} must hold texts of shape {shape}")
        self.budget -= 64 * data.size
        if self.budget < 0:
            raise self.error(f"the data sets are larger than {self.allowed / 2**30:.3g} GiB")
        return [printable(str(text)) for text in data.asstr()[()].ravel()]

    def words(self, name: str) -> tuple[str, ...]:
        """Names along a dimension."""
        found = self.texts(name, *(self.data(name).shape or (0,)))
        if len(set(found)) < len(found) or not all(0 < len(word) <= NAMED for word in found):
            raise self.error(f"{name} must be different names")
        return tuple(found)

    def families(self, observers: Sequence[str]) -> dict[str, tuple[str, int | None]]:
        """Types of the observers and orders of their filters, where the file has them."""
        if "observer_type" not in self.file:
            return {}
        types = self.texts("observer_type", len(observers))
        orders = self.numbers("filter_order", len(observers)) if "filter_order" in self.file else [-1.0] * len(types)
        return {
            label: (kind, int(order) if order >= 0 else None)
            for label, kind, order in zip(observers, types, orders, strict=True)
        }

    def trajectories(self, size: int, m: int, n: int) -> Trajectories:
        member = self.numbers("trajectories/member", None)
        if not np.all(np.isin(member, np.arange(size))):
            raise self.error("trajectories/member must be places among the members")
        time = self.times("trajectories/time")
        k, nt = member.size, time.size
        return Trajectories(
            member=member.astype(np.int64),
            time=time,
            x=self.numbers("trajectories/x", k, nt, n),
            xhat=self.numbers("trajectories/xhat", k, m, nt, n),
        )
