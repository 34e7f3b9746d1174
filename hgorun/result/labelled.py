"""A result as one labelled xarray data set."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from hgorun.errors import HgorunError
from hgorun.result.data import ResultData

if TYPE_CHECKING:
    import xarray


def to_xarray(result: ResultData) -> xarray.Dataset:
    """Truth, estimates and outputs of a result as one labelled data set."""
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
    estimates = (
        np.stack([o.xhat for o in result.observers.values()]) if result.observers else np.zeros((0, *result.x.shape))
    )
    return xarray.Dataset(
        {
            "x": (("time", "state"), result.x),
            "u": (("time", "input"), result.u),
            "y": (("time", "output"), result.y),
            "xhat": (("observer", "time", "state"), estimates),
        },
        coords=coordinates,
        attrs={"title": result.title, "seed": result.seed, "units": json.dumps(dict(result.units))},
    )
