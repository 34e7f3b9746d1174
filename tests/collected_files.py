"""Collected files of made-up numbers, written with h5py alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

TEXT = h5py.string_dtype()


def write(
    path: Path,
    axes: Mapping[str, Any],
    metrics: Mapping[str, np.ndarray],
    *,
    observers: Sequence[str],
    states: Sequence[str],
    status: np.ndarray | None = None,
    member: bool = False,
    types: Mapping[str, tuple[str, int]] | None = None,
    units: Mapping[str, str] | None = None,
    trajectories: Mapping[str, np.ndarray] | None = None,
) -> Path:
    """Write a collected file.

    Parameters
    ----------
    axes : mapping of str to sequence
        The dimensions in front; with ``member`` coordinates of one dimension.
    metrics : mapping of str to ndarray, shape (axes..., observer, state)
    """
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "hgorun-sweep-1"
        file.attrs["name"] = path.name.partition(".")[0]
        file.attrs["axes"] = list(axes)
        if units is not None:
            file.attrs["units"] = json.dumps(dict(units))
        front = ["member"] if member else list(axes)
        if member:
            size = len(next(iter(axes.values())))
            scale(file, "member", np.arange(size))
            for name, values in axes.items():
                data = file.create_dataset(name, data=column(values))
                data.dims[0].attach_scale(file["member"])
        else:
            for name, values in axes.items():
                scale(file, name, column(values))
        scale(file, "observer", column(observers))
        scale(file, "state", column(states))
        for name, values in metrics.items():
            variable(file, name, values, [*front, "observer", "state"])
        shape = next(iter(metrics.values())).shape[:-1]
        given = np.zeros(shape, dtype=np.int8) if status is None else status.astype(np.int8)
        variable(file, "status", given, [*front, "observer"])
        file["status"].attrs["flag_meanings"] = "ok inaccurate diverged undefined failed"
        variable(file, "error", np.full(shape[:-1], "", dtype=object), front)
        if types is not None:
            variable(file, "observer_type", column([types[label][0] for label in observers]), ["observer"])
            variable(file, "filter_order", np.array([types[label][1] for label in observers]), ["observer"])
        for name, values in (trajectories or {}).items():
            file[f"trajectories/{name}"] = values
    return path


def column(values: Sequence[Any]) -> np.ndarray:
    """Numbers, or texts as objects."""
    return np.array(values, dtype=object) if all(isinstance(v, str) for v in values) else np.asarray(values)


def scale(file: h5py.File, name: str, values: np.ndarray) -> None:
    """A dimension with its coordinate."""
    data = file.create_dataset(name, data=values, dtype=TEXT if values.dtype == object else None)
    data.make_scale(name)


def variable(file: h5py.File, name: str, values: np.ndarray, dimensions: Sequence[str]) -> None:
    """Values along dimensions."""
    data = file.create_dataset(name, data=values, dtype=TEXT if values.dtype == object else None)
    for axis, dimension in enumerate(dimensions):
        data.dims[axis].attach_scale(file[dimension])
