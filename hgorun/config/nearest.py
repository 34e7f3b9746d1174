"""What somebody may have meant: the most similar name, or what a key is called elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

# What others call the keys of a configuration.
_CALLED_ELSEWHERE = {
    **dict.fromkeys(("dt", "delta_t", "sample_time"), ("output_step", "step", "period")),
    **dict.fromkeys(("ts", "t_s", "sampling_time", "rate"), ("period", "output_step")),
    **dict.fromkeys(("tf", "t_f", "tspan", "duration", "horizon"), ("end",)),
    **dict.fromkeys(("x0", "ic", "init", "x_0", "start_values"), ("initial",)),
    **dict.fromkeys(("sigma", "stddev", "standard_deviation", "variance"), ("std",)),
    "rms": ("rmse", "std"),
    **dict.fromkeys(("gain", "l", "high_gain", "ell"), ("theta", "gains")),
    **dict.fromkeys(("ode", "f", "equations", "rhs", "eqs", "model"), ("dynamics", "plant")),
    **dict.fromkeys(("y", "h", "measured", "sensor"), ("output", "measurement")),
    **dict.fromkeys(("u", "control"), ("inputs", "controller")),
    **dict.fromkeys(("time", "tau"), ("t",)),
    **dict.fromkeys(("p", "constants", "consts"), ("parameters",)),
    **dict.fromkeys(("eigenvalues", "k"), ("poles", "gains")),
    **dict.fromkeys(("lag", "latency", "dead_time"), ("delay",)),
    **dict.fromkeys(("integrator", "simulation"), ("solver", "method", "time")),
    **dict.fromkeys(("estimators", "filters", "filter"), ("observers",)),
}


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return " Did you mean `x`?" with the candidate most like ``name``, or called so elsewhere, or "" if none is."""
    import difflib

    known = {candidate.lower(): candidate for candidate in islice(candidates, 1_000) if len(candidate) < 100}
    elsewhere = next((other for other in _CALLED_ELSEWHERE.get(name.lower(), ()) if other in known), None)
    if elsewhere is not None:
        return f" Did you mean `{known[elsewhere]}`?"
    close = difflib.get_close_matches(name[:100].lower(), known, n=1, cutoff=0.5 if len(name) < 4 else 0.6)
    return f" Did you mean `{known[close[0]]}`?" if close else ""
