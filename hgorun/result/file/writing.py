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

from hgorun.result.file.closed_file import write_closed
from hgorun.result.file.recorded_file import write_assessed, write_inputs, write_recorded
from hgorun.result.hdf5 import digests
from hgorun.result.hdf5.forms import RESULT
from hgorun.result.hdf5.sink import hdf5_written_whole
from hgorun.result.hdf5.writer import Writer, labels_of, units_in
from hgorun.result.metrics.base import all_metrics
from hgorun.result.records.data import PLANT, DesignNumbers, ResultData
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.status import OK, Verdict

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
    with hdf5_written_whole(path, form(len(result.observers))) as file:
        write(result, Writer(file))
    return path


def digests_of(result: ResultData) -> dict[str, str]:
    """The digests of all data sets that :func:`save` would write, by their paths."""
    with h5py.File(
        "digests", "w", driver="core", backing_store=False, track_order=True, libver=form(len(result.observers))
    ) as file:
        write(result, Writer(file))
        return digests.of_file(file)


def form(observers: int) -> tuple[str, str] | None:
    """The form of the file: in the oldest one a dimension cannot have more than some 4,000 data sets."""
    return ("v108", "v108") if observers > _MANY else None


def _measured_states(result: ResultData) -> Any:
    """Of every output the state that it is, or nothing."""
    known = result.measures
    return None if known is None else labels_of(tuple(known.get(output, "") for output in result.outputs))


def write(result: ResultData, w: Writer) -> None:
    """Write a result into an open file."""
    file = w.file
    for key, value in _root_attributes(result).items():
        file.attrs[key] = value.encode(errors="replace").decode() if isinstance(value, str) else value
    units = result.units
    w.scale("time", result.time, units=units.get("time", ""), long_name="time")
    w.names("plant_state", result.states)
    w.names("plant_input", result.inputs)
    w.names("plant_output", result.outputs)
    of_states = units_in(units, result.states)
    if result.recorded is None:
        _write_truth(w, result, of_states)
    else:
        write_recorded(w, result, result.recorded)
    write_closed(w, result)
    if result.design is not None:
        _write_design(w, result.design)
    w.group("observers")
    w.group("metrics")
    for label, o in result.observers.items():
        _write_observer(w, result, label, o, of_states)
        if o.assessed is not None:
            write_assessed(w, result, label, o.assessed, of_states)
    groups = {label: w.group(f"observers/{label}") for label in result.observers} | {PLANT: w.group("plant")}
    errors = result.integration_error or {}
    for label in groups.keys() & errors.keys():
        groups[label].attrs["integration_error"] = errors[label]
    file.attrs[digests.ATTRIBUTE] = digests.of_attributes(file)


def _write_truth(w: Writer, result: ResultData, of_states: str | None) -> None:
    """The simulated plant, and what was measured of it."""
    unit = result.units.get("time", "")
    w.data(
        "plant/x",
        result.x,
        ("time", "plant_state"),
        labels=labels_of(result.states),
        long_name="state",
        units=of_states,
    )
    write_inputs(w, result)
    of_outputs = units_in(result.units, result.outputs)
    w.data(
        "plant/y",
        result.y,
        ("time", "plant_output"),
        labels=labels_of(result.outputs),
        long_name="noise-free output",
        units=of_outputs,
        measures=_measured_states(result),
    )
    if result.verdict != OK:
        w.group("plant").attrs.update(_said(result.verdict))
    m = result.measurements
    # their dimension is the number of the measurement: a second dimension called time would clash with the grid
    w.scale("measurement/number", m.every * np.arange(m.time.size), long_name="number of the measurement")
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
        labels=labels_of(result.outputs),
        long_name="measurement that the observers got",
        units=of_outputs,
    )


def _write_design(w: Writer, design: DesignNumbers) -> None:
    for name, values, meaning in (
        ("parameters", design.parameters, "parameters of the plant, of signals and of observers"),
        ("start", design.start, "states of the plant and of the observers at the start"),
    ):
        data = w.data(f"design/{name}", values, long_name=meaning)
        if values.size:  # netCDF wants every axis to have a dimension
            w.index(data, 0, values.size)
    w.group("design").attrs["step"] = design.step


def _write_observer(w: Writer, result: ResultData, label: str, o: ObserverResult, units: str | None) -> None:
    base = f"observers/{label}"
    w.data(
        f"{base}/xhat",
        o.xhat,
        ("time", "plant_state"),
        labels=labels_of(result.states),
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
    if o.unestimated:
        attributes["unestimated"] = " ".join(o.unestimated)
    if o.diverged_at is not None:
        attributes["diverged_at"] = o.diverged_at
    w.group(f"metrics/{label}")
    known, of_time = all_metrics(closed=True), result.units.get("time") or None
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
        "format": RESULT,
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
        if result.unresolved:
            found["unresolved"] = json.dumps(result.unresolved)
        found["integration"] = json.dumps(result.integration.told())
    if result.kind != "simulation":
        found["kind"] = result.kind
    if result.recorded is not None and result.recorded.time_origin:
        found["time_origin"] = result.recorded.time_origin
    if result.remarks:
        found["remarks"] = json.dumps(list(result.remarks))
    return found
