"""What is given to an estimator: numbers, numbers by name, observers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hgorun.errors import Problem
from hgorun.simulation.experiment import Experiment


def as_number(name: str, value: Any) -> float:
    """A number, or a sentence that says what was expected.

    Raises
    ------
    TypeError
    """
    try:
        if not isinstance(value, str | bytes | bytearray):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"{name}: expected a number, found {value!r:.50}")


def numbers_by_name(name: str, values: Any) -> list[tuple[str, float]]:
    """Numbers with their names, of a mapping.

    Raises
    ------
    TypeError
    """
    if not isinstance(values, dict | Mapping):
        raise TypeError(f"{name}: expected numbers by name, as {{'a': 0.5}}, found {values!r:.50}")
    return [
        (one, value if type(value) is float else as_number(f"{name}[{one!r}]", value)) for one, value in values.items()
    ]


def require_observers(experiment: Experiment) -> None:
    """Refuse an experiment that estimates nothing.

    Raises
    ------
    Problem
    """
    if not experiment.observers:
        raise Problem(("observers",), "there are none: give one, for instance SHGO: {type: shgo, theta: 5, poles: -1}")
