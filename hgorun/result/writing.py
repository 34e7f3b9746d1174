"""Write a result.

A file is written under a temporary name and renamed, so a reader never sees half of one. Equal results
are equal files but for the attribute ``created``.
"""

from __future__ import annotations

import hashlib
import json
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hgorun.result import digests
from hgorun.result.data import PLANT, DesignNumbers, ObserverResult, ResultData
from hgorun.result.metrics.base import all_metrics
from hgorun.result.sink import hdf5_written_whole
from hgorun.result.status import OK, Verdict

FORMAT = "hgorun-result-1"
_CHUNK = 2**20
_MANY = 100  # observers


def save(result: ResultData, path: Path) -> Path:
    """Write a result.

    Parameters
    ----------
    result : ResultData
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
    with hdf5_written_whole(path, _form(result)) as file:
        _write(result, file)
    return path


def digests_of(result: ResultData) -> dict[str, str]:
    """The digests of all data sets that :func:`save` would write, by their paths."""
    with h5py.File("digests", "w", driver="core", backing_store=False, track_order=True, libver=_form(result)) as file:
        _write(result, file)
        return digests.of_file(file)


def _form(result: ResultData) -> tuple[str, str] | None:
    """The form of the file: in the oldest one a dimension cannot have more than some 4,000 data sets."""
    return ("v108", "v108") if len(result.observers) > _MANY else None


class _Writer:
    """Data sets without time stamps, each with its dimensions named."""

    def __init__(self, file: h5py.File) -> None:
        self.file = file
        # kept, since h5py needs as long to find one as to write it
        self._groups: dict[str, h5py.Group] = {"": file}
        self._scales: dict[str, h5py.Dataset] = {}

    def group(self, path: str) -> h5py.Group:
        if path not in self._groups:
            self._groups[path] = self.file.create_group(path, track_order=True)
        return self._groups[path]

    def data(self, path: str, values: Any, dimensions: tuple[str, ...] = (), **attributes: Any) -> h5py.Dataset:
        parent, _, name = path.rpartition("/")
        group, array = self.group(parent), np.asarray(values)
        if array.dtype.kind == "O":
            data = group.create_dataset(name, data=values, track_times=False)
            data.attrs[digests.ATTRIBUTE] = digests.of_names([str(name) for name in array])
        else:
            data = group.create_dataset(name, data=array, track_times=False, **_checked(array))
            data.attrs[digests.ATTRIBUTE] = digests.of_numbers(array)
        for axis, dimension in enumerate(dimensions):
            data.dims[axis].attach_scale(self._scales[dimension])
        for key, value in attributes.items():
            if value is not None:
                data.attrs[key] = value
        return data

    def scale(self, path: str, values: Any, **attributes: Any) -> None:
        data = self.data(path, values, **attributes)
        data.make_scale(path.rpartition("/")[2])
        self._scales[path] = data

    def index(self, data: h5py.Dataset, axis: int, size: int) -> None:
        """A dimension without coordinates: netCDF wants every axis to have one, and those of one length share it."""
        dimension = f"index_{size}"
        if dimension not in self._scales:
            self.scale(dimension, np.arange(1, size + 1))
        data.dims[axis].attach_scale(self._scales[dimension])

    def names(self, path: str, names: tuple[str, ...]) -> None:
        """A dimension whose coordinate is a list of names."""
        if names:
            self.scale(path, np.array(names, dtype=object).astype(h5py.string_dtype()))


def _checked(array: np.ndarray) -> dict[str, Any]:
    """Checksums in the file, which HDF5 keeps for each chunk: whole rows, of about a MiB."""
    if not array.ndim or not array.size:
        return {}
    rows = max(1, min(len(array), _CHUNK // max(array[:1].nbytes, 1)))
    return {"fletcher32": True, "chunks": (rows, *array.shape[1:])}


def _labels(names: tuple[str, ...]) -> Any:
    return np.array(names, dtype=object).astype(h5py.string_dtype()) if names else None


def _measured_states(result: ResultData) -> Any:
    """Of every output the state that it is, or nothing."""
    known = result.measures
    return None if known is None else _labels(tuple(known.get(output, "") for output in result.outputs))


def _write(result: ResultData, file: h5py.File) -> None:
    w = _Writer(file)
    for key, value in _root_attributes(result).items():
        file.attrs[key] = value.encode(errors="replace").decode() if isinstance(value, str) else value
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
        measures=_measured_states(result),
    )
    if result.verdict != OK:
        w.group("plant").attrs.update(_said(result.verdict))
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
    w.data("measurement/taken", m.taken, numbered, units=unit, long_name="time it was measured")
    w.data(
        "measurement/y",
        m.y,
        numbered,
        labels=_labels(result.outputs),
        long_name="measurement that the observers got",
    )
    if result.design is not None:
        _write_design(w, result.design)
    w.group("observers")
    w.group("metrics")
    for label, o in result.observers.items():
        _write_observer(w, result, label, o, of_states)
    groups = {label: w.group(f"observers/{label}") for label in result.observers} | {PLANT: w.group("plant")}
    errors = result.integration_error or {}
    for label in groups.keys() & errors.keys():
        groups[label].attrs["integration_error"] = errors[label]
    file.attrs[digests.ATTRIBUTE] = digests.of_attributes(file)


def _write_design(w: _Writer, design: DesignNumbers) -> None:
    for name, values, meaning in (
        ("parameters", design.parameters, "parameters of the plant, of signals and of observers"),
        ("start", design.start, "states of the plant and of the observers at the start"),
    ):
        data = w.data(f"design/{name}", values, long_name=meaning)
        if values.size:  # netCDF wants every axis to have a dimension
            w.index(data, 0, values.size)
    w.group("design").attrs["step"] = design.step


def _write_observer(w: _Writer, result: ResultData, label: str, o: ObserverResult, units: str | None) -> None:
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
        data = w.data(f"{base}/state/{name}", values, ("time",))
        for axis, size in enumerate(values.shape[1:], start=1):
            w.index(data, axis, size)
    attributes = w.group(base).attrs
    attributes["type"] = o.type
    attributes["gains"] = json.dumps(o.gains)
    attributes.update(_said(o.verdict))
    attributes["dimension"] = o.dimension
    if o.coordinates is not None:
        attributes["map"] = o.coordinates.map
        attributes["chains"] = json.dumps(dict(o.coordinates.chains))
    if o.diverged_at is not None:
        attributes["diverged_at"] = o.diverged_at
    known, of_time = all_metrics(), result.units.get("time") or None
    for name, values in o.metrics.items():
        metric = known.get(name)
        w.data(
            f"metrics/{label}/{name}",
            values,
            ("plant_state",),
            units={"state": units, "time": of_time, "1": "1"}[metric.unit] if metric else None,
            long_name=metric.meaning if metric else None,
        )


def _said(verdict: Verdict) -> dict[str, str | float]:
    """A verdict as attributes: those that there are."""
    said = {"status": verdict.status, "status_at": verdict.at, "reason": verdict.reason}
    return {name: value for name, value in said.items() if value is not None}


def _root_attributes(result: ResultData) -> dict[str, Any]:
    import casadi
    import llvmlite

    from hgorun.native.compiler import processor
    from hgorun.version import __version__, source_revision

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
        "source_revision": source_revision(),
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "casadi_version": casadi.__version__,
        "llvmlite_version": llvmlite.__version__,
        "h5py_version": h5py.__version__,
        "hdf5_version": h5py.version.hdf5_version,
        "platform": platform.platform(),
        "processor": f"{platform.machine()} {processor()[0]}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "status": result.status,
        "units": json.dumps(dict(result.units)),
        "windows": json.dumps(dict(result.windows)),
    }
    if result.integration is not None and result.integration_error is not None:
        found["integration_error"] = json.dumps(dict(result.integration_error))
        found["integration"] = json.dumps(result.integration.told())
    if result.remarks:
        found["remarks"] = json.dumps(list(result.remarks))
    return found
