"""What the columns of an ensemble decide: numbers that are written for many members at once, or more than that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_origin

import numpy as np
from numpy.typing import NDArray

from hgorun.config.expressions import parse
from hgorun.ensemble.members.members import Column, Members
from hgorun.measurement.noise import is_relative
from hgorun.noise.base import RandomNoise
from hgorun.simulation.experiment.experiment import Experiment

Place = tuple[int, int, int]  # of an item of noise: output, stretch, number


@dataclass(frozen=True, kw_only=True)
class Axes:
    """The paths of an ensemble by what they decide.

    Attributes
    ----------
    start, parameters : mapping of str to int
        Initial values and parameters of the plant, with their places among its states and its parameters.
    observers : mapping of str to tuple of str
        By label the paths inside an observer's block.
    deviations : mapping of str to tuple of Place
        Standard deviations of gaussian noise, with the items that they are of.
    seed : bool
        Whether the seed is among them, and decides nothing but noise.
    others : tuple of str
        What may change the equations or the times of events.
    """

    start: Mapping[str, int]
    parameters: Mapping[str, int]
    observers: Mapping[str, tuple[str, ...]]
    deviations: Mapping[str, tuple[Place, ...]]
    seed: bool
    others: tuple[str, ...]

    @classmethod
    def of(cls, base: Experiment, members: Members) -> Axes:
        """Sort the paths."""
        start: dict[str, int] = {}
        parameters: dict[str, int] = {}
        observers: dict[str, tuple[str, ...]] = {}
        deviations: dict[str, tuple[Place, ...]] = {}
        seed, others = False, []
        nested = _nested(list(members.columns))
        for path, column in members.columns.items():
            keys, numeric = path.split("."), column.dtype.kind in "fi"
            if nested:
                others.append(path)
            elif path == "seed" and column.dtype.kind == "i" and not _seed_decides_times(base):
                seed = True
            elif numeric and keys[:2] == ["plant", "initial"] and keys[2:] and _is_state(base, keys[2]):
                start[path] = base.plant.model.states.index(keys[2])
            elif numeric and keys[:2] == ["plant", "parameters"] and keys[2:] and _stands_alone(base, keys[2]):
                parameters[path] = base.plant.model.parameters.index(keys[2])
            elif keys[0] == "observers" and len(keys) > 2 and _is_number(base, keys[1], keys[2]):
                observers[keys[1]] = (*observers.get(keys[1], ()), path)
            elif numeric and (places := _deviations(base, path)):
                deviations[path] = places
            else:
                others.append(path)
        return cls(
            start=start,
            parameters=parameters,
            observers=observers,
            deviations=deviations,
            seed=seed,
            others=tuple(others),
        )

    @property
    def of_plant(self) -> tuple[str, ...]:
        """The paths of the plant's numbers."""
        return *self.start, *self.parameters

    @property
    def of_noise(self) -> bool:
        """Whether members differ in their noise."""
        return self.seed or bool(self.deviations)


def _nested(paths: Sequence[str]) -> bool:
    """Whether one path leads into what another one replaces."""
    return any(a != b and b.startswith(f"{a}.") for a in paths for b in paths)


def _seed_decides_times(base: Experiment) -> bool:
    """Whether samples move or are lost by chance."""
    sampled = [s for one in base.stretches for s in one if s.period is not None]
    return any(s.regular is None for s in sampled)


def _is_state(base: Experiment, name: str) -> bool:
    relative = any(is_relative(s) for one in base.stretches for s in one)
    return name in base.plant_block.initial and not relative


def _stands_alone(base: Experiment, name: str) -> bool:
    """Whether a parameter is no part of another one, and the size of the noise does not depend on it."""
    relative = any(is_relative(s) for one in base.stretches for s in one)
    texts = base.plant_block.parameters
    used = any(name in parse(text).names for other, text in texts.items() if other != name)
    return name in base.plant.model.parameters and not used and not relative


def _is_number(base: Experiment, label: str, key: str) -> bool:
    """Whether a key of an observer is no word or whole number, on which its equations may depend."""
    observer = base.observers.get(label)
    field = None if observer is None else type(observer).model_fields.get(key)
    return (
        field is not None and get_origin(field.annotation) is not Literal and field.annotation not in (int, str, bool)
    )


def _deviations(base: Experiment, path: str) -> tuple[Place, ...]:
    """The items of noise whose draws the number at a path multiplies."""
    found = []
    for i, stretches in enumerate(base.stretches):
        for k, s in enumerate(stretches):
            for j, item in enumerate(s.noise):
                if isinstance(item, RandomNoise) and item.scaled_by is not None and not item.relative():
                    own = ".".join(map(str, (*s.paths["noise"], j, item.scaled_by)))
                    found += [(i, k, j)] if own == path else []
    return tuple(found)


def distinct_rows(columns: Sequence[Column]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of members that differ in some columns: the first of each kind, and the kind of every member.

    Parameters
    ----------
    columns : sequence of ndarray, shape (N,)
        One at least.
    """
    codes = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        values = column if column.dtype.kind == "i" else np.array([repr(value) for value in column])
        if column.dtype.kind == "f":
            values = np.ascontiguousarray(column, dtype=float).view(np.int64)  # zeros have signs
        _, own = np.unique(values, return_inverse=True)
        _, codes = np.unique(codes * (int(own.max(initial=0)) + 1) + own.ravel(), return_inverse=True)
    _, first, kind = np.unique(codes, return_index=True, return_inverse=True)
    return first.astype(np.int64), kind.ravel().astype(np.int64)
