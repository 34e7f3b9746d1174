"""A result as labelled data of other packages: an xarray data set, a table of pandas."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.errors import HgorunError
from hgorun.result.records.data import ResultData
from hgorun.result.records.recorded import Recorded

if TYPE_CHECKING:
    import pandas
    import xarray


def to_xarray(result: ResultData) -> xarray.Dataset:
    """Truth, estimates and outputs of a result as one labelled data set; of recorded data the samples and bands.

    The samples of a recorded output, such as S, have a dimension of their own: ``S``, ``S_taken``, ``S_available``
    along ``S_sample``. In a closed loop ``driven`` and ``driven_u`` are of the plants that the observers drive; x and u
    are of the one that its true state drives.
    """
    try:
        import xarray
    except ImportError as error:
        raise HgorunError("to_xarray needs the package xarray: pip install 'hgorun[xarray]'") from error
    coordinates = {
        "time": ("time", result.time, {"units": result.units.get("time", "")}),
        "state": list(result.states),
        "output": list(result.outputs),
        "input": list(result.inputs),
        "observer": list(result.observers),
    }
    estimated = ("observer", "time", "state")
    observers = result.observers.values()
    shape = (result.time.size, len(result.states))
    found: dict[str, Any] = {
        "u": (("time", "input"), result.u),
        "xhat": (estimated, _stacked([o.xhat for o in observers], shape)),
    }
    if result.recorded is None:
        found |= {"x": (("time", "state"), result.x), "y": (("time", "output"), result.y)}
    else:
        assessed = [o.assessed for o in observers if o.assessed is not None]
        found["lower"] = (estimated, _stacked([one.lower for one in assessed], shape))
        found["upper"] = (estimated, _stacked([one.upper for one in assessed], shape))
        found |= dict(_samples(result.recorded))
    if result.closed_loop:
        loops = [result.closed_loop[label] for label in result.observers]
        size = result.time.size, len(result.inputs)
        found["driven"] = estimated, _stacked([loop.x for loop in loops], shape)
        found["driven_u"] = ("observer", "time", "input"), _stacked([loop.u for loop in loops], size)
    attributes = {"title": result.title, "seed": result.seed, "units": json.dumps(dict(result.units))}
    return xarray.Dataset(found, coords=coordinates, attrs=attributes)


def _stacked(arrays: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    return np.stack(arrays) if arrays else np.zeros((0, *shape))


def _samples(recorded: Recorded) -> Iterator[tuple[str, tuple[str, np.ndarray]]]:
    for name, output in recorded.outputs.items():
        of_it = f"{name}_sample"
        yield name, (of_it, output.y)
        yield f"{name}_taken", (of_it, output.taken)
        yield f"{name}_available", (of_it, output.available)


def to_pandas(result: ResultData) -> pandas.DataFrame:
    """Truth and estimates of a result as a table with a row for every time.

    Columns are pairs: ``("plant", state)`` and ``("plant", input)``, ``(label, state)``, and of recorded data, where
    there is no truth, ``(label, "S_lower")`` and ``(label, "S_upper")`` besides.
    """
    try:
        import pandas
    except ImportError as error:
        raise HgorunError("to_pandas needs the package pandas: pip install 'hgorun[pandas]'") from error
    columns = dict(_columns(result))
    names = pandas.MultiIndex.from_tuples(list(columns), names=["source", "quantity"])
    values = np.column_stack(list(columns.values())) if columns else np.zeros((result.time.size, 0))
    return pandas.DataFrame(values, index=pandas.Index(result.time, name="time"), columns=names)


def _columns(result: ResultData) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    if result.recorded is None:
        yield from ((("plant", state), result.x[:, k]) for k, state in enumerate(result.states))
    yield from ((("plant", name), result.u[:, k]) for k, name in enumerate(result.inputs))
    for label, observer in result.observers.items():
        for k, state in enumerate(result.states):
            yield (label, state), observer.xhat[:, k]
            if observer.assessed is not None:
                yield (label, f"{state}_lower"), observer.assessed.lower[:, k]
                yield (label, f"{state}_upper"), observer.assessed.upper[:, k]
