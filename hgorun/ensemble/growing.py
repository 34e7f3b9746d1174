"""Ensembles as they are read in Python: a collected file, or the folder while it is carried out."""

from __future__ import annotations

import math
import os
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hgorun.ensemble.collected.collected import Collected, Trajectories, as_text, last_point
from hgorun.ensemble.collected.reading import QUANTITIES, read
from hgorun.ensemble.collected.rows import joined, part
from hgorun.ensemble.collected.units import units_of
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.values import Drawn
from hgorun.errors import ConfigError, HgorunError
from hgorun.observers.capabilities import FilterOrder
from hgorun.result.hdf5.stored import LARGEST, budget_of
from hgorun.result.records.status import STATUSES

if TYPE_CHECKING:
    import xarray

_FLAGS = {"flag_values": np.arange(len(STATUSES), dtype=np.int8), "flag_meanings": " ".join(STATUSES)}


class Sweep(Collected):
    """The members of an ensemble: arrays of :class:`~hgorun.ensemble.collected.collected.Collected`, with conveniences.

    The most used ones, with N members, m observers and n states:

    Attributes
    ----------
    axes : mapping of str to ndarray, shape (N,)
        The value of every axis for every member.
    observers, states : tuple of str
        Labels and names, in the order of the arrays.
    metrics : mapping of str to ndarray, shape (N, m, n)
        In the units of the states; infinite where an observer is lost.
    error : ndarray of text, shape (N,)
        Why a member has failed; empty where it has not.
    """

    def _repr_html_(self) -> str:
        """In a notebook: the axes, and medians of the observers' metrics."""
        from hgorun.ensemble.notebook import as_html

        return as_html(self)

    def to_xarray(self) -> xarray.Dataset:
        """Metrics and statuses with labelled coordinates; needs the package xarray.

        The axes are dimensions where all members of a product are there, else coordinates of ``member``.
        """
        try:
            import xarray
        except ImportError as error:
            raise HgorunError("to_xarray needs the package xarray: pip install 'hgorun[xarray]'") from error
        whole = bool(self.dimensions) and "member" not in self.dimensions
        front = tuple(self.dimensions) if whole else ("member",)
        shape = tuple(self.dimensions.values()) if whole else (len(self),)
        found = xarray.Dataset(
            {
                **{
                    name: ((*front, "observer", "state"), values.reshape(*shape, *values.shape[1:]))
                    for name, values in self.metrics.items()
                },
                "status": ((*front, "observer"), self.status.reshape(*shape, -1), _FLAGS),
                "error": (front, self.error.reshape(shape)),
            },
            coords={"observer": list(self.observers), "state": list(self.states)},
            attrs={"name": self.name, "title": self.title},
        )
        if self.quantities:
            values = np.stack(list(self.quantities.values()), axis=-1).reshape(*shape, -1)
            found = found.assign({QUANTITIES: ((*front, "quantity"), values)})
            found = found.assign_coords({"quantity": list(self.quantities)})
        if not whole:
            return found.assign_coords({path: ("member", values) for path, values in self.axes.items()})
        own = {path: self.axes[path].reshape(shape).swapaxes(0, k) for k, path in enumerate(front)}
        return found.assign_coords({path: values.reshape(len(values), -1)[:, 0] for path, values in own.items()})


def read_sweep(path: str | Path, *, max_memory: float = LARGEST) -> Sweep:
    """Read the members of an ensemble.

    Parameters
    ----------
    path : path
        A collected file (``NAME.sweep.h5``), or the folder (``NAME.sweep``) in which it is made: then the members
        that are finished.
    max_memory : float
        Bytes that the numbers may take; 1 GiB by default, ``inf`` for any.

    Returns
    -------
    Sweep

    Raises
    ------
    ConfigError
        When it is not an ensemble, damaged, larger than allowed, or no member is finished.

    Examples
    --------
    >>> kept = hgorun.sweep(experiment, {"observers.SHGO.theta": [2, 4]}, output="gains.sweep.h5")
    >>> hgorun.read_sweep("gains.sweep.h5").metrics["rmse"].shape  # members, observers, states
    (2, 2, 2)
    """
    path = Path(path)
    found = _finished(Store.existing(path), max_memory) if os.path.isdir(path) else read(path, max_memory=max_memory)
    return Sweep(**{field.name: getattr(found, field.name) for field in fields(Collected)})


def _finished(store: Store, max_memory: float) -> Collected:
    ensemble = store.ensemble
    base = ensemble.base
    blocks, numbers, kept = [], [], []
    budget: float = budget_of(max_memory)
    for carried, which in store.blocks():
        blocks.append(part(carried.block, which))
        numbers.append(np.arange(carried.start + which.start, carried.start + which.stop))
        budget -= sum(values.nbytes for values in blocks[-1].metrics.values())
        if carried.followed is not None:
            kept.append(carried.followed)
            budget -= carried.followed.x.nbytes + carried.followed.xhat.nbytes
        if budget < 0:
            raise ConfigError(f"its numbers take more than {max_memory / 2**30:.3g} GiB", file=str(store.folder))
    if not blocks:
        raise ConfigError("no member is finished yet", file=str(store.folder))
    block, members = joined(blocks), np.concatenate(numbers)
    clock = base.blocks.time
    same_end = not any(path.startswith("time.") for path in ensemble.axes)
    return Collected(
        name=ensemble.name,
        title=ensemble.title or base.blocks.title,
        axes=_axes(ensemble, numbers),
        observers=block.observers,
        states=block.states,
        metrics=block.metrics,
        status=block.status,
        error=block.error,
        units=units_of(base, ensemble.axes),
        random=frozenset(path for path, values in ensemble.axes.items() if isinstance(values, Drawn)),
        families={label: (o.type, o.r if isinstance(o, FilterOrder) else None) for label, o in base.observers.items()},
        dimensions=ensemble.dimensions if members.size == store.size else {},
        planned=store.size,
        trajectories=_kept(kept, members),
        quantities=dict(zip(map(str, ensemble.quantities), block.quantities.T, strict=True)),
        settling=base.blocks.metrics.settling,
        end=last_point(clock.start, clock.end, clock.output_step) if same_end else math.inf,
        integration_error=block.integration_error,
    )


def _axes(ensemble: Ensemble, numbers: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The values on every axis of members whose numbers come in pieces without gaps."""
    pieces = [ensemble.values(int(one[0]), int(one[-1]) + 1) for one in numbers]
    return {path: _as_collected(np.concatenate([piece[path] for piece in pieces])) for path in ensemble.axes}


def _as_collected(values: np.ndarray) -> np.ndarray:
    """Values as a collected file holds them, where those that are not all numbers are texts."""
    return np.array([as_text(value) for value in values.tolist()], "O") if values.dtype.kind == "O" else values


def _kept(found: list[Trajectories], members: np.ndarray) -> Trajectories | None:
    """Trajectories of blocks, which say members by their numbers, with their places among those that are there."""
    if not found:
        return None
    numbers, first = np.unique(np.concatenate([one.member for one in found]), return_index=True)
    return Trajectories(
        member=np.searchsorted(members, numbers),
        time=found[0].time,
        x=np.concatenate([one.x for one in found])[first],
        xhat=np.concatenate([one.xhat for one in found])[first],
    )
