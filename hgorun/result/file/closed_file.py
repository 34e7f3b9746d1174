"""Closed loops in a result file: ``/closed_loop/<label>``, and ``/closed_loop/plant`` of the true state."""

from __future__ import annotations

from hgorun.result.hdf5.stored import StoredFile, is_number
from hgorun.result.hdf5.writer import Writer, labels_of, units_in
from hgorun.result.records.closed import ClosedLoop
from hgorun.result.records.data import PLANT, ResultData

GROUP = "closed_loop"


def write_closed(w: Writer, result: ResultData) -> None:
    """Write all loops; what /plant has of the one with the true state is not written again."""
    of_states, of_inputs, of_outputs = (
        {"labels": labels_of(names), "units": units_in(result.units, names)}
        for names in (result.states, result.inputs, result.outputs)
    )
    if result.closed_loop:
        w.group(GROUP)
    for label, loop in result.closed_loop.items():
        base = f"{GROUP}/{label}"
        w.group(base)
        if label != PLANT:
            w.data(f"{base}/x", loop.x, ("time", "plant_state"), long_name="state of the driven plant", **of_states)
            w.data(f"{base}/u", loop.u, ("time", "plant_input"), long_name="input", **of_inputs)
            w.data(f"{base}/y", loop.y, ("time", "plant_output"), long_name="noise-free output", **of_outputs)
        for name, values in loop.integral.items():
            w.data(f"{base}/integral/{name}", values, ("time",), long_name="integral of the controller")
        w.data(f"{base}/effort", loop.effort, ("plant_input",), long_name="integral of u^2")
        largest = {"long_name": "largest |u|", "units": of_inputs["units"]}
        w.data(f"{base}/peak_input", loop.peak_input, ("plant_input",), **largest)
        if loop.cost is not None:
            w.group(base).attrs["cost"] = loop.cost


def read_closed(file: StoredFile, shape: tuple[int, int, int, int], labels: tuple[str, ...]) -> dict[str, ClosedLoop]:
    """What :func:`write_closed` has written; nothing of an open loop.

    Parameters
    ----------
    shape : (Nt, n, m, q)
    labels : tuple of str
        Of the observers.

    Raises
    ------
    ConfigError
    """
    if GROUP not in file.file:
        return {}
    names = (PLANT, *labels)
    if set(file.group(GROUP)) != set(names):
        raise file.error(f"{GROUP} must have a group for every observer and for {PLANT}")
    return {label: _loop(file, label, shape) for label in names}


def _loop(file: StoredFile, label: str, shape: tuple[int, int, int, int]) -> ClosedLoop:
    nt, n, m, q = shape
    base = f"{GROUP}/{label}"
    group, arrays = file.group(base), PLANT if label == PLANT else base
    cost = group.attrs.get("cost")
    if cost is not None and not is_number(cost):
        raise file.error(f"{base}: attribute cost must be a number, found {cost!r:.50}")
    integrals = file.group(f"{base}/integral") if "integral" in group else ()
    return ClosedLoop(
        x=file.numbers(f"{arrays}/x", nt, n),
        u=file.numbers(f"{arrays}/u", nt, m),
        y=file.numbers(f"{arrays}/y", nt, q),
        integral={str(name): file.numbers(f"{base}/integral/{name}", nt) for name in integrals},
        effort=file.numbers(f"{base}/effort", m),
        peak_input=file.numbers(f"{base}/peak_input", m),
        cost=None if cost is None else float(cost),
    )
