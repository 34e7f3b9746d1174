"""Read a result file, which may come from anybody."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hgorun.errors import ConfigError
from hgorun.result import Measurements, ObserverResult, Result
from hgorun.store.writing import FORMAT

_LARGEST = 2**34  # bytes that a file may unpack to; compressed or sparse data sets could claim any size


def read(path: str | Path) -> Result:
    """Read a result file.

    Raises
    ------
    ConfigError
        When the file is missing, no result of hgorun, damaged, or larger than 16 GiB unpacked.
    """
    path = Path(path)
    if not path.is_file():
        raise ConfigError("no such file", file=str(path))
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path)
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"not a result file of hgorun: {reason}", file=str(path)) from error


def _read(file: h5py.File, path: Path) -> Result:
    if file.attrs.get("format") != FORMAT:
        raise ConfigError(
            f"not a result file of hgorun: attribute format is {file.attrs.get('format')!r}, expected {FORMAT!r}",
            file=str(path),
        )
    budget = [_LARGEST]

    def array(name: str) -> np.ndarray:
        data = file[name]
        if not isinstance(data, h5py.Dataset) or data.is_virtual or data.external:
            raise ConfigError(f"{name} is no ordinary data set", file=str(path))
        budget[0] -= data.nbytes
        if budget[0] < 0:
            raise ConfigError("the data sets are larger than 16 GiB", file=str(path))
        return np.asarray(data[()])

    def numbers(name: str, *shape: int) -> np.ndarray:
        values = array(name).astype(float)
        if shape and values.shape != shape:
            raise ConfigError(f"{name} has shape {values.shape}, expected {shape}", file=str(path))
        return values

    def labels(name: str) -> tuple[str, ...]:
        return tuple(str(v) for v in file[name].attrs["labels"])

    states, outputs = labels("plant/x"), labels("plant/y")
    inputs = labels("plant/u") if "plant/u" in file else ()
    time = numbers("time")
    nt, n = time.size, len(states)
    observers = {}
    for label, group in file["observers"].items():
        internal = {name: numbers(f"observers/{label}/state/{name}") for name in group["state"]}
        metrics = {name: numbers(f"metrics/{label}/{name}", n) for name in file[f"metrics/{label}"]}
        observers[label] = ObserverResult(
            str(group.attrs["type"]),
            numbers(f"observers/{label}/xhat", nt, n),
            internal,
            json.loads(group.attrs["gains"]),
            int(group.attrs["dimension"]),
            float(group.attrs["diverged_at"]) if "diverged_at" in group.attrs else None,
            metrics,
        )
    y_times = numbers("measurement/time")
    measurements = Measurements(
        y_times,
        numbers("measurement/taken", y_times.size, len(outputs)),
        numbers("measurement/y", y_times.size, len(outputs)),
    )
    error = file.attrs.get("integration_error")
    return Result(
        str(file.attrs["name"]),
        str(file.attrs["title"]),
        time,
        numbers("plant/x", nt, n),
        numbers("plant/u", nt, len(inputs)) if inputs else np.zeros((nt, 0)),
        numbers("plant/y", nt, len(outputs)),
        states,
        inputs,
        outputs,
        _mapping(file.attrs["units"]),
        measurements,
        observers,
        str(file.attrs["config"]),
        str(file.attrs["config_resolved"]),
        int(file.attrs["seed"]),
        _mapping(file.attrs["windows"]),
        _mapping(error) if error is not None else None,
    )


def _mapping(text: Any) -> Mapping[str, Any]:
    value = json.loads(text)
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object among the attributes")
    return value
