"""What axes of ensembles and points on them are called in tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from hgorun.ensemble.collected.collected import shown
from hgorun.tables.typeset import TIMES, printable, time_unit

_LONG = 40  # columns; names of points that are longer have only the values
_MOST_DIGITS = 17


def short_axis(axis: str, axes: Sequence[str]) -> str:
    """The end of an axis's path, with whose it is where it is that of an output or does not differ from other ends.

    >>> axes = ["observers.F.theta", "observers.S.theta", "measurement.sampling.period"]
    >>> [short_axis(axis, axes) for axis in axes]
    ['theta of F', 'theta of S', 'period']
    >>> short_axis("measurement.outputs.phi.noise.0.std", axes)
    'std of phi'
    """
    shorter: tuple[Callable[[str], str], ...] = (_end, _whose)
    for short in shorter:
        if all(short(other) != short(axis) for other in axes if other != axis):
            return short(axis)
    return axis


def output_of(axis: str) -> str:
    """The output that a path below ``measurement`` is of; empty where it is of all, and elsewhere."""
    first, *parts = axis.split(".")
    place = parts.index("outputs") + 1 if first == "measurement" and "outputs" in parts[:-2] else 0
    return parts[place] if place else ""


def _end(axis: str) -> str:
    output, end = output_of(axis), _key(axis)
    return f"{end} of {output}" if output else end


def _key(axis: str) -> str:
    return axis.rpartition(".")[2]


def _whose(axis: str) -> str:
    _, *owner, end = axis.split(".") if "." in axis else ("", axis)
    return f"{end} of {'.'.join(owner)}" if owner else end


def unit_of_axis(axis: str, units: Mapping[str, str]) -> str:
    """The unit of an axis's values; empty where they have none, or it is not known.

    Parameters
    ----------
    axis : str
    units : mapping of str to str
        Of ``time``, and of paths that are no times.
    """
    if "." in axis and axis in units:  # other names are those of states and outputs
        return units[axis]
    return time_unit(units) if _key(axis) in TIMES else ""


def bracketed(unit: str) -> str:
    """A unit behind a name: ``" [h]"``; nothing without one."""
    return f" [{printable(unit)}]" if unit else ""


def names_of_values(values: Iterable[Any]) -> dict[Any, str]:
    """Values of an axis as tables show them, each with so many digits as tell them all apart."""
    known = list(dict.fromkeys(values))
    found = [shown(value) for value in known]
    for digits in range(5, _MOST_DIGITS + 1):
        if len(set(found)) == len(known):
            break
        found = [f"{value:.{digits}g}" if isinstance(value, float) else shown(value) for value in known]
    return dict(zip(known, found, strict=True))


def names_of_points(
    points: Sequence[Mapping[str, Any]], axes: Sequence[str], units: Mapping[str, str] = MappingProxyType({})
) -> tuple[str, list[str]]:
    """What is said above a table with a row for each point, and what its rows are called.

    Parameters
    ----------
    points : sequence of mapping of str to value
        Values on the axes.
    axes : sequence of str
    units : mapping of str to str
        Of ``time``, and of axes that are no times.

    Returns
    -------
    (str, list of str)
        Nothing and ``theta = 2, period = 0.1``, ...; where that is long ``theta, period`` and ``2, 0.1``, ...
    """
    values = {axis: names_of_values(point[axis] for point in points) for axis in axes}
    short = {axis: short_axis(axis, axes) for axis in axes}
    of_axes = {axis: unit_of_axis(axis, units) for axis in axes}
    full = [
        ", ".join(f"{short[axis]} = {values[axis][point[axis]]} {of_axes[axis]}".rstrip() for axis in axes)
        for point in points
    ]
    if max(map(len, full), default=0) <= _LONG:
        return "", full
    above = ", ".join(name + bracketed(of_axes[axis]) for axis, name in short.items())
    return above, [", ".join(values[axis][point[axis]] for axis in axes) for point in points]
