"""The members of an ensemble: what each of them changes of a base experiment, as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hgorun.config.expressions import nearest
from hgorun.config.misdirected import refuse_lost
from hgorun.config.nearest import listed
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.experiment import Experiment

Column: TypeAlias = NDArray[Any]  # of numbers, or of objects where values are text or lists
_ALL = ("observers", "*")  # how a path begins that means every observer
_TO_A_KEY = 2  # keys of a path to an observer: what is longer leads into its block


@dataclass(frozen=True, eq=False)
class Members:
    """What the members of an ensemble change, a column for each path.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (size,)
        By path, as after ``--set``; ``observers.*.theta`` means every observer that can have it. Where two paths lead
        to one place, the later one holds.
    size : int
        How many members there are.

    Examples
    --------
    >>> Members.of({"observers.FHGO.theta": [2.0, 3.0], "seed": [0, 1]}).changes(1)
    {'observers.FHGO.theta': 3.0, 'seed': 1}
    """

    columns: Mapping[str, Column]
    size: int

    @classmethod
    def of(cls, values: Mapping[str, Sequence[Any] | Column], size: int | None = None) -> Members:
        """Members from the values of each path, all of one length.

        Parameters
        ----------
        size : int, optional
            How many members there are, where no path says so.

        Raises
        ------
        ValueError
            For columns of different lengths.
        """
        columns = {path: _column(one) for path, one in values.items()}
        sizes = {column.shape[0] for column in columns.values()} | ({size} if size is not None else set())
        if len(sizes) > 1:
            raise ValueError(f"columns of different lengths: {sorted(sizes)}")
        return cls(columns, sizes.pop() if sizes else 1)

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, which: slice | NDArray[np.int64] | Sequence[int]) -> Members:
        """Some of the members."""
        places = np.arange(self.size)[which]
        return Members({path: column[places] for path, column in self.columns.items()}, places.size)

    def changes(self, i: int) -> dict[str, Any]:
        """What member i changes, for :meth:`hgorun.simulation.experiment.experiment.Experiment.varied`."""
        values = {path: column[i] for path, column in self.columns.items()}
        return {path: v.item() if isinstance(v, np.generic) else v for path, v in values.items()}

    def of_observers(self, base: Experiment) -> Members:
        """The same, with ``observers.*`` written out: a column for every observer that has such a key.

        Raises
        ------
        ConfigError
            Where none has it.
        """
        columns: dict[str, Column] = {}
        for path, column in self.columns.items():
            for place in written_out(base, path):
                columns.pop(place, None)  # the later one holds
                columns[place] = column
        return Members(columns, self.size)


def written_out(base: Experiment, path: str) -> list[str]:
    """The paths that a path stands for: several where it begins with ``observers.*``.

    Raises
    ------
    ConfigError
        Where no observer has the key, or is called so, and where only the end of a path is given.
    """
    keys = path.split(".")
    if keys[0] not in base.source.data:
        refuse_lost(base.source.data, (), keys)
    if tuple(keys[:2]) != _ALL:
        if keys[0] == "observers" and len(keys) > _TO_A_KEY and not _begins_with_a_label(base, path):
            there = tuple(base.observers)
            message = f"no observer is called {keys[1]!r}.{nearest(keys[1], there)} Known: {listed(there, keys[1])}"
            raise ConfigError(message, key=path)
        return [path]
    key = keys[2] if len(keys) > 2 else ""
    labels = [label for label, observer in base.observers.items() if key in type(observer).model_fields]
    if not labels:
        known = dict.fromkeys(name for observer in base.observers.values() for name in type(observer).model_fields)
        raise ConfigError(f"no observer has the key {key!r}.{nearest(key, known)}".removesuffix("."), key=path)
    free = [label for label in labels if not _excluded(base, label, keys[2:])]
    return [".".join(("observers", label, *keys[2:])) for label in free or labels]


def _begins_with_a_label(base: Experiment, path: str) -> bool:
    return any(path.startswith(f"observers.{label}.") for label in base.observers)


def _excluded(base: Experiment, label: str, keys: Sequence[str]) -> bool:
    """Whether what a block says otherwise leaves no room for a key, as ``Q`` of a Kalman filter does for ``theta``."""
    block = base.observers[label]
    if len(keys) > 1 or keys[0] in block.model_fields_set or type(block).model_fields[keys[0]].default is not None:
        return False
    try:
        base.varied({f"observers.{label}.{keys[0]}": 1.0})
    except ConfigError:
        return True
    return False


def _column(values: Sequence[Any] | Column) -> Column:
    """An array of numbers where all values are; else one of objects, which may be text or lists."""
    if isinstance(values, np.ndarray) and values.ndim == 1:
        return values
    given = list(values)
    kinds = {type(value) for value in given}
    if kinds <= {int, float, np.float64, np.int64} and given:
        return np.array(given)
    column = np.empty(len(given), dtype=object)
    column[:] = given
    return column
