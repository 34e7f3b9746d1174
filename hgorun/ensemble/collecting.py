"""The members of an ensemble collected into one file, which opens as an xarray data set.

The file follows from the members alone: not from the blocks in which they came, nor from who has carried them out or
when. It is written batch by batch, so that memory does not grow with the number of members.
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.config.sweeps import Worst
from hgorun.engine.methods import METHODS
from hgorun.ensemble.collected.collected import Trajectories
from hgorun.ensemble.collected.layout import MEMBER, Column, Layout
from hgorun.ensemble.collected.reading import QUANTITIES
from hgorun.ensemble.collected.rows import batches, part
from hgorun.ensemble.collected.trajectories import chosen, follow
from hgorun.ensemble.collected.units import units_of
from hgorun.ensemble.folder.store import COLLECTED, Store
from hgorun.ensemble.found import Block
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.recipe import written
from hgorun.errors import HgorunError
from hgorun.files import json_value, remove_leftovers, write_text
from hgorun.observers.capabilities import FilterOrder
from hgorun.result.hdf5.forms import SWEEP
from hgorun.result.hdf5.sink import hdf5_written_whole
from hgorun.result.metrics.base import all_metrics
from hgorun.result.records.status import STATUSES
from hgorun.version import __version__

_BATCH = 4096  # members that are in memory together


def collect(store: Store, path: Path) -> Path:
    """Write the file of an ensemble all of whose members have been carried out, whole or not at all.

    Raises
    ------
    HgorunError
        When members are missing, a block is damaged, the file cannot be written, or the folder has been begun anew.
    """
    missing = store.missing()
    if missing:
        count = sum(stop - start for start, stop in missing)
        raise HgorunError(
            f"{store.folder}: {count} of {store.size} members are missing, the first is {missing[0][0]}: "
            "run the sweep again, or merge the folders of all its parts"
        )
    remove_leftovers(path.parent)
    with hdf5_written_whole(path) as file:
        _write(store, file)
        store.refuse_replaced()
    write_text(store.folder / COLLECTED, json.dumps(_known(store, path), indent=1))
    return path


def is_collected(store: Store, path: Path) -> bool:
    """Whether the file of an ensemble has the bytes that were collected last, with the titles and texts of today."""
    try:
        known = json.loads((store.folder / COLLECTED).read_text(encoding="utf-8"))
        return bool(known == _known(store, path))
    except (OSError, ValueError, RecursionError):
        return False


def _known(store: Store, path: Path) -> dict[str, str]:
    """What tells a collected file from any other one."""
    with path.open("rb") as file:
        content = file_digest(file, "sha256").hexdigest()
    said = sha256(store.recipe.encode()).hexdigest()
    return {"fingerprint": store.manifest.fingerprint, "recipe": said, "sha256": content}


def _write(store: Store, file: h5py.File) -> None:
    ensemble = store.ensemble
    layout = Layout(file, ensemble.dimensions, _coordinates(ensemble))
    for name, value in _attributes(store).items():
        file.attrs[name] = value
    _dimensions(ensemble, layout)
    columns = _columns(ensemble, layout)
    worst, kept = _Worst(ensemble), None
    start = 0
    for batch in batches((part(carried.block, which) for carried, which in store.blocks()), _BATCH):
        stop = start + len(batch)
        for name, values in ensemble.values(start, stop).items() if ensemble.combine != "product" else ():
            columns[name].write(start, values)
        for name, values in _arrays(batch).items():
            if name in columns:
                columns[name].write(start, values)
        worst.look_at(start, batch)
        start = stop
    for column in columns.values():
        column.close()
    if isinstance(ensemble.keep.trajectories, Worst):
        kept = follow(ensemble, worst.members)
        if kept is not None:
            layout.trajectories(len(kept.member), kept.time).write(0, kept)
    else:
        _followed(store, layout)
    file.attrs["status"] = STATUSES[worst.status]


def _attributes(store: Store) -> dict[str, Any]:
    """All that is said of the ensemble as a whole."""
    ensemble, base = store.ensemble, store.ensemble.base
    return {
        "format": SWEEP,
        "Conventions": "CF-1.8",
        "name": ensemble.name,
        "title": ensemble.title or base.blocks.title,
        "axes": np.array(list(ensemble.axes), dtype=h5py.string_dtype()),
        "sweep": json.dumps(json_value(written(ensemble.blocks))),
        "config": ensemble.text.encode(errors="replace").decode(),
        "config_resolved": base.resolved_text,
        "seed": base.blocks.seed,
        "fingerprint": store.manifest.fingerprint,
        "hgorun_version": __version__,
        "units": json.dumps(units_of(base, ensemble.axes)),
    }


def _coordinates(ensemble: Ensemble) -> str | None:
    """Names of the coordinates that are no dimensions, as CF wants them: without those that hold a space."""
    if ensemble.combine == "product":
        return None
    return " ".join(path for path in ensemble.axes if " " not in path) or None


def _dimensions(ensemble: Ensemble, layout: Layout) -> None:
    base = ensemble.base
    if ensemble.combine == "product":
        for path, values in ensemble.axes.items():
            layout.scale(path, values.size, (values.at(places) for places in _places(values.size)))
    else:
        layout.scale(MEMBER, ensemble.size, _places(ensemble.size), long_name="number of the member")
    layout.names("observer", tuple(base.observers))
    layout.names("state", base.plant.model.states)
    if ensemble.quantities:
        layout.names("quantity", tuple(map(str, ensemble.quantities)))
    observers = base.observers.values()
    layout.fixed("observer_type", np.array([o.type for o in observers], dtype=object), ("observer",))
    orders = [o.r if isinstance(o, FilterOrder) else -1 for o in observers]
    layout.fixed("filter_order", np.array(orders, dtype=np.int64), ("observer",), long_name="-1: it has no filter")


def _places(size: int) -> Iterator[NDArray[np.int64]]:
    return (np.arange(start, min(start + _BATCH, size)) for start in range(0, size, _BATCH))


def _columns(ensemble: Ensemble, layout: Layout) -> dict[str, Column]:
    """Everything that has a value for every member."""
    base, known = ensemble.base, all_metrics(closed=True)
    unit = base.blocks.time.unit
    each = [base.plant.units.get(state, "") for state in base.plant.model.states]
    of_states = (each[0] if len(set(each)) == 1 else "; ".join(each)) if any(each) else None
    units = {"state": of_states, "time": unit or None, "1": "1"}
    columns: dict[str, Column] = {}

    def add(name: str, kind: Any, inner: tuple[str, ...] = (), **attributes: Any) -> None:
        columns[name] = layout.column(name, kind, inner, **attributes)

    for path, values in ensemble.axes.items() if ensemble.combine != "product" else ():
        add(path, values.at(np.arange(1)).dtype)
    for name in ensemble.metrics:
        add(name, float, ("observer", "state"), units=units[known[name].unit], long_name=known[name].meaning)
    add("status", np.int8, ("observer",), **_flags(STATUSES))
    add("status_at", float, ("observer",), units=unit, long_name="the time that the status is about")
    add("diverged_at", float, ("observer",), units=unit, long_name="when the estimate has left the truth for good")
    add("reason", object, ("observer",), long_name="why the status is not ok")
    add("error", object, long_name="why the member has failed")
    add("plant_status", np.int8, **_flags(STATUSES))
    add("method", np.int8, **_flags(("none", *METHODS)))
    add("step", float, units=unit, long_name="longest step of the integration, where steps are fixed")
    add("rtol", float, long_name="relative tolerance of the integration, where it controls the steps")
    add("evaluations", np.int64, long_name="evaluations of the right-hand side")
    add("integration_error", float, ("observer",), long_name="relative error of the metrics by the integration")
    add("plant_integration_error", float, long_name="relative error of the truth by the integration")
    if ensemble.quantities:
        add(QUANTITIES, float, ("quantity",))
    return columns


def _flags(words: tuple[str, ...]) -> dict[str, Any]:
    return {"flag_values": np.arange(len(words), dtype=np.int8), "flag_meanings": " ".join(words)}


def _arrays(batch: Block) -> dict[str, NDArray[Any]]:
    """The columns of a batch, as the file has them."""
    places = {"": 0} | {name: i for i, name in enumerate(METHODS, start=1)}
    return {
        **batch.metrics,
        "status": batch.status,
        "status_at": batch.status_at,
        "diverged_at": batch.diverged_at,
        "reason": batch.reason,
        "error": batch.error,
        "plant_status": batch.plant_status,
        "method": np.array([places[name] for name in batch.method], dtype=np.int8),
        "step": batch.step,
        "rtol": batch.rtol,
        "evaluations": batch.evaluations,
        "integration_error": batch.integration_error[:, 1:],
        "plant_integration_error": batch.integration_error[:, 0],
        QUANTITIES: batch.quantities,
    }


def _followed(store: Store, layout: Layout) -> None:
    """Trajectories that are kept because of the members' numbers."""
    members = chosen(store.ensemble.keep.trajectories, 0, store.size)
    if not members:
        return
    group, at = None, 0
    for carried, which in store.blocks():
        found = _within(carried.followed, carried.start + which.start)
        if found is None or not found.member.size:
            continue
        group = group or layout.trajectories(len(members), found.time)
        group.write(at, found)
        at += found.member.size


def _within(followed: Trajectories | None, start: int) -> Trajectories | None:
    """Those of members from a number on."""
    if followed is None:
        return None
    stay = followed.member >= start
    return Trajectories(member=followed.member[stay], time=followed.time, x=followed.x[stay], xhat=followed.xhat[stay])


class _Worst:
    """The members with the largest values of a metric, and the worst status, of all that have been looked at."""

    def __init__(self, ensemble: Ensemble) -> None:
        self.status = 0
        self._kept = ensemble.keep.trajectories
        self._observers, self._states = tuple(ensemble.base.observers), ensemble.base.plant.model.states
        self._largest: list[tuple[float, int]] = []  # the smallest of them first, with numbers below 0

    def look_at(self, start: int, batch: Block) -> None:
        """Take further members into account."""
        self.status = max(self.status, int(batch.status.max(initial=0)), int(batch.plant_status.max(initial=0)))
        if not isinstance(self._kept, Worst):
            return
        values = batch.metrics[self._kept.by]
        if self._kept.observer is not None:
            values = values[:, [self._observers.index(self._kept.observer)]]
        if self._kept.state is not None:
            values = values[..., [self._states.index(self._kept.state)]]
        largest = np.nan_to_num(values.reshape(len(batch), -1), nan=-np.inf, posinf=np.inf).max(axis=1, initial=-np.inf)
        for i in np.flatnonzero(batch.error == ""):
            one = float(largest[i]), -(start + int(i))
            if len(self._largest) < self._kept.worst:
                heapq.heappush(self._largest, one)
            elif one > self._largest[0]:
                heapq.heapreplace(self._largest, one)

    @property
    def members(self) -> list[int]:
        """Their numbers, the worst first."""
        return [-number for _, number in sorted(self._largest, reverse=True)]
