"""Keys that stand in another block of a configuration than their own: where each is written."""

from __future__ import annotations

from hgorun.errors import KeyPath

_ANY = "NAME"  # of an observer, an output, a figure, a run
_AVAILABLE = "measurement"  # whose keys single outputs and phases have, too


def _below(block: str, keys: str) -> dict[str, str]:
    """The keys of a block by what they are written as."""
    return {key: f"{block}.{key}" for key in keys.split()}


_WRITTEN = {
    **_below("time", "start end output_step"),
    **_below("solver", "method step accuracy max_evaluations rtol atol max_step divergence"),
    **_below("metrics", "window transient average settling record"),
    **_below(_AVAILABLE, "sampling delay noise mode phases"),
    **_below(f"{_AVAILABLE}.sampling", "period offset jitter dropout times steps"),
    **{key: f"{_AVAILABLE}.noise: [{{type: gaussian, {key}: ...}}]" for key in ("std", "snr_db")},
    **_below("plant", "states dynamics output inputs parameters units disturbance discretise"),
    **_below(
        f"observers.{_ANY}", "theta poles gains saturation internal clip_estimate coordinates map chains late hold"
    ),
    **_below("controller", "law integral anti_windup truth cost"),
    **_below("data", "file origin first_samples csv faults reference"),
    **_below(f"data.outputs.{_ANY}", "plausible quality available gate"),
    **_below("tune", "minimise subject held_out budget"),
    **_below(f"runs.{_ANY}", "seeds vary"),
    **_below(f"figures.{_ANY}", "panels"),
    **{key: key for key in ("plant", "measurement", "observers", "solver", "metrics")},
    **{key: key for key in ("controller", "figures", "claims", "runs", "seed")},
}
_ALSO = {
    "initial": ("plant.initial", f"observers.{_ANY}.initial"),
    "outputs": ("measurement.outputs", "data.outputs"),
}  # where there are several
_BEHIND = ("delay", "lag", "latency")  # how late samples are
_OF_SAMPLES = ("plausible", "quality", "gate", "available", "std")  # which inputs have not
_OUTLIER = ("outlier", "spike", "peak")
_AT_TOP = "at the top of the file"


def belongs(place: KeyPath, key: str, *, recorded: bool = True) -> str:
    """Where a key is written that is not known at a place: `` Did you mean `measurement.delay`?``, or "".

    Parameters
    ----------
    place : tuple
        The path of the block that has the key.
    key : str
    recorded : bool
        Whether the configuration has recorded data: a key of these alone is not proposed to a simulation.
    """
    if place[:2] == ("data", "outputs") and key in _BEHIND:
        return f" The column of times at which samples are known is `{_dotted((*place, 'available'))}`."
    if place[:2] == ("data", "inputs") and key in _OF_SAMPLES:
        missing = f"{_dotted((*place, 'csv'))}: {{missing: [...]}}"
        return f" An input is taken as it is recorded; values that stand for none are left out by `{missing}`."
    if place[:1] == ("data",) and place[-1:] == ("faults",) and key.removesuffix("s") in _OUTLIER:
        return " Outliers are left out by `gate` or `plausible` of an output."
    written = _ALSO.get(key) or ((_WRITTEN[key],) if key in _WRITTEN else ())
    found = [_from(place, one) for one in written if _fits(place, one)]
    if written and not recorded and all(one.startswith("data.") for one in written):
        return f" `{key}` is for recorded data, as `{_from(place, written[0])}`: see `hgorun estimate`."
    found = [f"`{one}`{f' {_AT_TOP}' if one == key else ''}" for one in found if one != _dotted((*place, key))]
    return f" Did you mean {' or '.join(found)}?" if found else ""


def _fits(place: KeyPath, written: str) -> bool:
    """Whether it may be meant: beside recorded data a block ``measurement`` says next to nothing."""
    return not (place[:1] == ("data",) and written.startswith(_AVAILABLE))


def _from(place: KeyPath, written: str) -> str:
    """What is written for the observer, the output or the phase that a place is in."""
    if place[:1] == ("observers",) and len(place) > 1:
        return written.replace(f"observers.{_ANY}", _dotted(place[:2]), 1)
    if place[:2] == ("data", "outputs") and len(place) > 2:
        return written.replace(f"data.outputs.{_ANY}", _dotted(place[:3]), 1)
    if place[:1] == (_AVAILABLE,) and written.startswith(f"{_AVAILABLE}."):
        return f"{_dotted(_available(place))}{written.removeprefix(_AVAILABLE)}"
    return written


def _available(place: KeyPath) -> KeyPath:
    """The output or the phase of ``measurement`` that a path is in; the block itself where it is in none."""
    end = 1
    while place[end : end + 1] in (("outputs",), ("phases",)) and len(place) > end + 1:
        end += 2
    return place[:end]


def _dotted(path: KeyPath) -> str:
    return ".".join(map(str, path))
