"""The members of an ensemble divided by their values on axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, levels


def points(members: Collected, by: Sequence[str]) -> Iterator[tuple[dict[str, Any], Collected]]:
    """The members divided by their values on axes; combinations that no member has are left out.

    Parameters
    ----------
    members : Collected
    by : sequence of str
        Axes.

    Yields
    ------
    (dict, Collected)
        Values on those axes, and the members that have them.
    """
    group = _groups(members, by)
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    for own in np.split(order, starts[1:]) if len(members) else ():
        inside = np.zeros(len(members), dtype=bool)
        inside[own] = True
        first = int(own[0])
        yield {axis: _value(members.axes[axis][first]) for axis in by}, members.where(inside)


def thinned(members: Collected, by: Sequence[str], most: int) -> Collected:
    """The members at every so many-th point of axes, so that there are at most ``most`` points."""
    group = _groups(members, by)
    count = int(group.max(initial=-1)) + 1
    return members if count <= most else members.where(group % -(-count // most) == 0)


def _groups(members: Collected, by: Sequence[str]) -> NDArray[np.int64]:
    """The number of the point at which each member is; points are counted in the order of the axes' values."""
    if not by:
        return np.zeros(len(members), dtype=np.int64)
    places = np.column_stack([_places(members.axes[axis], levels(members.axes[axis])) for axis in by])
    return np.asarray(np.unique(places, axis=0, return_inverse=True)[1], dtype=np.int64).ravel()


def _value(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _places(values: NDArray[Any], known: Sequence[Any]) -> NDArray[np.int64]:
    """Where the members stand among the values of an axis."""
    if values.dtype.kind in "iuf":
        return np.searchsorted(np.array(known), values)
    place = {value: i for i, value in enumerate(known)}
    return np.array([place[value] for value in values.tolist()], dtype=np.int64)
