"""An ensemble as its collected file holds it: the numbers of every member, read back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.config.expressions import nearest
from hgorun.config.named import Named, name_keys
from hgorun.config.nearest import listed
from hgorun.errors import ConfigError, printable
from hgorun.result.records.status import STATUSES
from hgorun.simulation.timeline.grid import points_up_to

SEED = "seed"
_NAMED = 20  # values of an axis in a message
_OK = (STATUSES.index("ok"), STATUSES.index("inaccurate"))  # there are numbers

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectories:
    """The trajectories that were kept.

    Attributes
    ----------
    member : ndarray of int, shape (K,)
        Whose they are: places among the members.
    time : ndarray, shape (Nt,)
    x : ndarray, shape (K, Nt, n)
    xhat : ndarray, shape (K, m, Nt, n)
    """

    member: NDArray[np.int64]
    time: Floats
    x: Floats
    xhat: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Collected:
    """The members of an ensemble, N of them with m observers of a plant of n states.

    Attributes
    ----------
    name, title : str
    axes : mapping of str to ndarray, shape (N,)
        The value of every axis for every member, numbers or texts; in the order in which the axes were written.
    observers, states : tuple of str
        Labels and names, in the order of the arrays.
    metrics : mapping of str to ndarray, shape (N, m, n)
    status : ndarray of int8, shape (N, m)
        Places in :data:`hgorun.result.records.status.STATUSES`.
    error : ndarray of text, shape (N,)
        Why a member has failed; empty where it has not.
    units : mapping of str to str
        Of the states, and of ``time``.
    random : frozenset of str
        Axes besides the seed whose values are random draws.
    families : mapping of str to (str, int or None)
        Of every observer, where it is known, its type and the order of its filter.
    dimensions : mapping of str to int
        Those along which the members lie, the last one fastest; nothing where some of them are missing.
    planned : int
        How many members there will be; more than N while the ensemble is carried out.
    trajectories : Trajectories or None
    quantities : mapping of str to ndarray, shape (N,)
        What else was measured, by its text.
    settling : float
        The part of its peak below which an error has settled.
    end : float
        The last output point of every member; infinite where they end at different times.
    integration_error : ndarray, shape (N, 1 + m)
        Of the plant and of the observers; NaN where none was estimated. No rows where nothing is known.
    """

    name: str
    title: str = ""
    axes: Mapping[str, NDArray[Any]]
    observers: tuple[str, ...]
    states: tuple[str, ...]
    metrics: Mapping[str, Floats]
    status: NDArray[np.int8]
    error: NDArray[np.object_]
    units: Mapping[str, str] = field(default_factory=dict)
    random: frozenset[str] = frozenset()
    families: Mapping[str, tuple[str, int | None]] = field(default_factory=dict)
    dimensions: Mapping[str, int] = field(default_factory=dict)
    planned: int = 0
    trajectories: Trajectories | None = None
    quantities: Mapping[str, Floats] = field(default_factory=dict)
    settling: float = 0.05
    end: float = math.inf
    integration_error: Floats = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        name_keys(self, axes="axis", metrics="metric", families="observer", quantities="quantity")

    def __len__(self) -> int:
        return int(self.status.shape[0])

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Whose numbers can be used: those of estimates that are ok or inaccurate; shape (N, m)."""
        return np.isin(self.status, _OK)

    @property
    def worst(self) -> str:
        """The worst status of all observers in all members."""
        return STATUSES[int(self.status.max(initial=0))]

    @property
    def all_ok(self) -> bool:
        """Whether every observer is ok in every member."""
        return not self.status.any()

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """Of every observer, how many members have each status that occurs."""
        found: dict[str, dict[str, int]] = {}
        for label, status in zip(self.observers, self.status.T, strict=True):
            numbers = np.bincount(status, minlength=len(STATUSES))
            found[label] = {word: int(n) for word, n in zip(STATUSES, numbers, strict=True) if n}
        return Named(found, "observer")

    @cached_property
    def chosen(self) -> tuple[str, ...]:
        """The axes with more than one value: without the seed, for chance is not chosen, and without axes that follow
        an earlier one, up or down, as those that one name sets together."""
        found: list[str] = []
        for axis, values in self.axes.items():
            many = axis != SEED and len(levels(values)) > 1
            if many and not any(_follows(values, self.axes[other]) for other in found):
                found.append(axis)
        return tuple(found)

    @property
    def grid(self) -> tuple[str, ...]:
        """Those of :attr:`chosen` that are no random draws."""
        return tuple(axis for axis in self.chosen if axis not in self.random)

    @property
    def gains(self) -> tuple[str, ...]:
        """Those of :attr:`grid` that a designer may choose: keys of observers."""
        return tuple(axis for axis in self.grid if axis.startswith("observers."))

    @property
    def surroundings(self) -> tuple[str, ...]:
        """Those of :attr:`grid` that are no choice of the observer's designer."""
        return tuple(axis for axis in self.grid if not axis.startswith("observers."))

    @cached_property
    def shared(self) -> tuple[str, ...]:
        """Random axes, the seed among them, on which several members have the same draw, and others another one."""
        counts = {axis: len(levels(values)) for axis, values in self.axes.items() if axis in {SEED, *self.random}}
        return tuple(axis for axis, count in counts.items() if 1 < count < len(self))

    @property
    def independent(self) -> bool:
        """Whether the members are independent draws: they differ in nothing that was chosen, and share no draw."""
        return not self.grid and not self.shared

    def axis(self, name: str) -> str:
        """The axis of a name: its path, or the end of it where that tells it from the others.

        Raises
        ------
        ConfigError
            When there is none, or several.
        """
        found = [name] if name in self.axes else [axis for axis in self.axes if axis.endswith(f".{name}")]
        if len(found) == 1:
            return found[0]
        known = listed(found or self.axes, name)
        ends = [*self.axes, *(axis.rpartition(".")[2] for axis in self.axes)]
        what = f"several axes end with {name!r}" if found else f"no axis is called {name!r}.{nearest(name, ends)}"
        raise ConfigError(f"{self.name}: {what} Known: {known}" if not found else f"{self.name}: {what}: {known}")

    def never(self, metric: str) -> NDArray[np.bool_]:
        """Whose moment has not come by the last output point, as that of an error that never settles.

        Parameters
        ----------
        metric : str
            One whose value is a moment.
        """
        values = self.metrics[metric]
        return np.asarray((values >= self.end) & np.isfinite(values) & self.sound[:, :, None])

    def where(self, members: NDArray[np.bool_]) -> Collected:
        """Some of the members.

        Parameters
        ----------
        members : ndarray of bool, shape (N,)
        """
        return replace(
            self,
            axes={axis: values[members] for axis, values in self.axes.items()},
            metrics={name: values[members] for name, values in self.metrics.items()},
            status=self.status[members],
            error=self.error[members],
            dimensions={},
            trajectories=_of_members(self.trajectories, members),
            quantities={text: values[members] for text, values in self.quantities.items()},
            integration_error=self.integration_error[members[: len(self.integration_error)]],
        )

    def at(self, axis: str, value: Any) -> NDArray[np.bool_]:
        """Which members have a value on an axis; of numbers that are not whole the digits that tables show have to
        agree.

        Raises
        ------
        ConfigError
            When none has it, with the values that there are.
        """
        values = self.axes[axis]
        if values.dtype.kind in "iuf":
            value = _number(value, axis)
        if values.dtype.kind in "iu":
            found = np.array([v == value for v in values.tolist()], dtype=bool)
        elif values.dtype.kind == "f":
            found = np.isclose(values.astype(float), value, rtol=1e-3, atol=0.0)
            distance = np.abs(values.astype(float) - value)
            found &= distance == np.min(distance, initial=np.inf, where=found)
        else:
            found = np.array([as_text(v) == as_text(value) for v in values], dtype=bool)
        if not found.any():
            known = [shown(v) for v in levels(values)]
            if len(known) > _NAMED:
                known[_NAMED - 1 : -1] = [f"... ({len(known)} values) ..."]
            raise ConfigError(f"no member has the value {shown(value)}; there are {', '.join(known)}", key=axis)
        return np.asarray(found)


def _number(value: object, axis: str) -> int | float:
    """A number from text, with all digits of an integer."""
    text = str(value)
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    raise ConfigError(f"expected a number, found {printable(text)!r}", key=axis)


def _follows(values: NDArray[Any], others: NDArray[Any]) -> bool:
    """Whether numbers grow, or fall, with others, and change with nothing else."""
    if values.dtype.kind not in "iuf" or others.dtype.kind not in "iuf":
        return False
    order = np.argsort(others, kind="stable")
    own, other = np.diff(values[order]), np.diff(others[order])
    return bool(np.all((other > 0) == (own > 0)) and np.all(own >= 0)) or bool(
        np.all((other > 0) == (own < 0)) and np.all(own <= 0)
    )


def levels(values: NDArray[Any]) -> list[Any]:
    """The values of an axis, each once: numbers sorted, texts as they come."""
    if values.dtype.kind in "iuf":
        return list(np.unique(values).tolist())
    return list(dict.fromkeys(values.tolist()))


def shown(value: Any) -> str:
    """A value of an axis as tables and figures show it."""
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))


def as_text(value: object) -> str:
    """A value of an axis that is not among numbers alone, as files and tables have it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _of_members(kept: Trajectories | None, members: NDArray[np.bool_]) -> Trajectories | None:
    """The trajectories of some of the members, which are counted anew."""
    if kept is None:
        return None
    stay = members[kept.member]
    places = np.cumsum(members) - 1
    return Trajectories(member=places[kept.member[stay]], time=kept.time, x=kept.x[stay], xhat=kept.xhat[stay])


def last_point(start: float, end: float, step: float) -> float:
    """The last point of an output grid, less what rounding may have taken off it."""
    return start + (points_up_to(start, end, step) - 1 - 1e-6) * step
