"""Results as HDF5 files in netCDF-4 conventions: nothing else in hgorun knows HDF5.

A file is written under a temporary name and renamed, so a reader never sees half of one. Equal results
are equal files but for the attribute ``created``.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from hgorun.errors import ConfigError, HgorunError
from hgorun.result import Measurements, ObserverResult, Result

if TYPE_CHECKING:
    import xarray

FORMAT = "hgorun-result-1"
_LARGEST = 2**34  # bytes that a file may unpack to; compressed or sparse data sets could claim any size


def save(result: Result, path: Path) -> Path:
    """Write a result.

    Parameters
    ----------
    result : Result
    path : Path
        Its folder is made when missing.

    Returns
    -------
    Path

    Raises
    ------
    HgorunError
        When the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem[:60]}-", suffix=".part")
        os.close(handle)
        try:
            with h5py.File(name, "w", track_order=True) as file:
                _write(result, file)
            os.chmod(name, 0o666 & ~_umask())
            os.replace(name, path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise HgorunError(f"{path}: cannot be written: {error.strerror or error}") from error
    return path


def _umask() -> int:
    """The process's file mode mask, which mkstemp ignores."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


class _Writer:
    """Data sets without time stamps, each with its dimensions named."""

    def __init__(self, file: h5py.File) -> None:
        self.file = file

    def group(self, path: str) -> h5py.Group:
        return (
            self.file.require_group(path)
            if path in self.file
            else self.file.create_group(path, track_order=True)
        )

    def data(
        self, path: str, values: Any, dimensions: tuple[str, ...] = (), **attributes: Any
    ) -> h5py.Dataset:
        parent, _, name = path.rpartition("/")
        group = self.group(parent) if parent else self.file
        data = group.create_dataset(name, data=values, track_times=False)
        for axis, dimension in enumerate(dimensions):
            data.dims[axis].attach_scale(self.file[dimension])
        for key, value in attributes.items():
            if value is not None:
                data.attrs[key] = value
        return data

    def scale(self, path: str, values: Any, **attributes: Any) -> None:
        data = self.data(path, values, **attributes)
        data.make_scale(path.rpartition("/")[2])

    def names(self, path: str, names: tuple[str, ...]) -> None:
        """A dimension whose coordinate is a list of names."""
        if names:
            data = self.data(path, np.array(names, dtype=object).astype(h5py.string_dtype()))
            data.make_scale(path.rpartition("/")[2])


def _labels(names: tuple[str, ...]) -> Any:
    return np.array(names, dtype=object).astype(h5py.string_dtype()) if names else None


def _write(result: Result, file: h5py.File) -> None:
    w = _Writer(file)
    for key, value in _root_attributes(result).items():
        file.attrs[key] = value
    units = result.units
    unit = units.get("time", "")
    w.scale("time", result.time, units=unit, long_name="time")
    w.names("plant_state", result.states)
    w.names("plant_input", result.inputs)
    w.names("plant_output", result.outputs)
    each = [units.get(s, "") for s in result.states]
    # one unit for all states, or one after the other in their order
    of_states = (each[0] if len(set(each)) == 1 else "; ".join(each)) if any(each) else None
    w.data(
        "plant/x",
        result.x,
        ("time", "plant_state"),
        labels=_labels(result.states),
        long_name="state",
        units=of_states,
    )
    if result.inputs:
        w.data("plant/u", result.u, ("time", "plant_input"), labels=_labels(result.inputs), long_name="input")
    w.data(
        "plant/y",
        result.y,
        ("time", "plant_output"),
        labels=_labels(result.outputs),
        long_name="noise-free output",
    )
    m = result.measurements
    # their dimension is the number of the measurement: a second dimension called time would clash with the grid
    w.scale("measurement/number", np.arange(m.time.size), long_name="number of the measurement")
    numbered = ("measurement/number", "plant_output")
    w.data(
        "measurement/time",
        m.time,
        numbered[:1],
        units=unit,
        long_name="when the measurement becomes available",
    )
    w.data("measurement/taken", m.taken, numbered, units=unit, long_name="time that it speaks of")
    w.data(
        "measurement/y",
        m.y,
        numbered,
        labels=_labels(result.outputs),
        long_name="measurement that the observers got",
    )
    w.group("observers")
    w.group("metrics")
    for label, o in result.observers.items():
        _write_observer(w, result, label, o, of_states)


def _write_observer(w: _Writer, result: Result, label: str, o: ObserverResult, units: str | None) -> None:
    base = f"observers/{label}"
    w.data(
        f"{base}/xhat",
        o.xhat,
        ("time", "plant_state"),
        labels=_labels(result.states),
        long_name="estimate",
        units=units,
    )
    w.group(f"{base}/state")
    for name, values in o.internal.items():
        data = w.data(f"{base}/state/{name}", values)
        data.dims[0].attach_scale(w.file["time"])
        for axis, size in enumerate(values.shape[1:], start=1):
            # netCDF wants every axis to have a dimension; those of one length share it
            dimension = f"index_{size}"
            if dimension not in w.file:
                w.scale(dimension, np.arange(1, size + 1))
            data.dims[axis].attach_scale(w.file[dimension])
    attributes = w.file[base].attrs
    attributes["type"] = o.type
    attributes["gains"] = json.dumps(o.gains)
    attributes["status"] = o.status
    attributes["dimension"] = o.dimension
    if o.diverged_at is not None:
        attributes["diverged_at"] = o.diverged_at
    for name, values in o.metrics.items():
        w.data(f"metrics/{label}/{name}", values, ("plant_state",))


def _root_attributes(result: Result) -> dict[str, Any]:
    import casadi
    import llvmlite

    from hgorun import __version__

    found = {
        "format": FORMAT,
        "Conventions": "CF-1.8",
        "name": result.name,
        "title": result.title,
        "config": result.config,
        "config_resolved": result.config_resolved,
        "config_sha256": hashlib.sha256(result.config_resolved.encode()).hexdigest(),
        "seed": result.seed,
        "hgorun_version": __version__,
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "casadi_version": casadi.__version__,
        "llvmlite_version": llvmlite.__version__,
        "platform": platform.platform(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "status": result.status,
        "units": json.dumps(dict(result.units)),
        "windows": json.dumps(dict(result.windows)),
    }
    if result.integration_error is not None:
        found["integration_error"] = json.dumps(dict(result.integration_error))
    return found


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


def to_xarray(result: Result) -> xarray.Dataset:
    """Truth, estimates and outputs of a result as one labelled data set."""
    try:
        import xarray
    except ImportError as error:
        raise HgorunError("to_xarray needs the package xarray: pip install 'hgorun[xarray]'") from error
    coordinates = {
        "time": ("time", result.time, {"units": result.units.get("time", "")}),
        "state": list(result.states),
        "output": list(result.outputs),
        "input": list(result.inputs),
        "observer": list(result.observers),
    }
    estimates = (
        np.stack([o.xhat for o in result.observers.values()])
        if result.observers
        else np.zeros((0, *result.x.shape))
    )
    return xarray.Dataset(
        {
            "x": (("time", "state"), result.x),
            "u": (("time", "input"), result.u),
            "y": (("time", "output"), result.y),
            "xhat": (("observer", "time", "state"), estimates),
        },
        coords=coordinates,
        attrs={"title": result.title, "seed": result.seed, "units": json.dumps(dict(result.units))},
    )
