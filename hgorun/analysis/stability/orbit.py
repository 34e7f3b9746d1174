"""Whether an error's linear systems come round again along a run: then they go on for ever, and its growth has a limit.

Of any other run that is not at rest the growth is known over that run alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hgorun.analysis.linear.error_system import ErrorSystem

_COARSE = 4000  # points of the run that a period is looked for at first
_POINTS = 500  # of a period, at least
_FEWEST = 40  # points of a run
_APART = 0.2  # root mean square, of the range: systems half a period apart differ by more
_NEAR = 0.1  # of the same: those a period apart differ by less on the coarse grid
_SAME = 2e-3  # of the range: the most by which the last period may differ from the one before
_PRECISION = 1e-3  # of a step of the grid
_NOTHING = 1e-9  # of the largest entry: the range of one that does not change


def on_orbit(system: ErrorSystem, unit: str = "") -> ErrorSystem:
    """The systems over one period, where the last period of a run is like the one before; else as they are.

    Parameters
    ----------
    system : ErrorSystem
        Along a run, on an even grid.
    unit : str
        Of time, for words.
    """
    if system.constant:
        return system
    values = _changing(system)
    for lag in _lags(values) if system.times.size >= _FEWEST else []:
        step = system.times[1] - system.times[0]
        cycle = _refined(system.times, values, lag * step, max(system.times.size // _COARSE, 1) * step)
        if cycle is not None:
            return _over(system, cycle, unit)
    return replace(system, where=f"{system.where}, neither at rest nor periodic: over a longer run it may be another")


def _changing(system: ErrorSystem) -> np.ndarray:
    """The entries that change along the run, shape (M, entries)."""
    parts = [part.reshape(system.times.size, -1) for part in (system.G, system.H)]
    kept = [part[:, np.ptp(part, axis=0) > _NOTHING * np.max(np.abs(part))] for part in parts]
    return np.concatenate(kept, axis=1)


def _lags(values: np.ndarray) -> list[int]:
    """How many points two stretches that are alike may be apart, the shortest first."""
    stride = max(len(values) // _COARSE, 1)
    coarse = values[::-stride]  # from the end, where transients are over
    spread = np.ptp(coarse, axis=0)
    coarse = coarse / np.where(spread > 0, spread, 1.0)
    apart = [0.0]
    for lag in range(1, len(coarse) // 2 + 1):
        apart.append(float(np.sqrt(np.mean((coarse[:lag] - coarse[lag : 2 * lag]) ** 2, axis=0).max(initial=0.0))))
    found, left = [], False
    for lag in range(1, len(apart) - 1):
        left = left or apart[lag] > _APART
        if left and apart[lag] < _NEAR and apart[lag] <= min(apart[lag - 1], apart[lag + 1]):
            found.append(lag * stride)
    return found


def _refined(times: np.ndarray, values: np.ndarray, about: float, step: float) -> float | None:
    """The period near a value; None where the last two are not alike."""
    from scipy.interpolate import CubicSpline
    from scipy.optimize import minimize_scalar

    longest = min(about + step, (times[-1] - times[0]) / 2)
    last = times[times >= times[-1] - about]
    known = times >= times[-1] - 2 * longest - 5 * step
    at = CubicSpline(times[known], values[known])
    now = at(last)
    spread = np.ptp(now, axis=0)
    spread = np.where(spread > 0, spread, 1.0)

    def apart(cycle: float) -> np.ndarray:
        return np.asarray(np.abs(at(last - cycle) - now) / spread)

    best = minimize_scalar(
        lambda cycle: float(np.mean(apart(cycle) ** 2)),
        bounds=(about - step, longest),
        method="bounded",
        options={"xatol": _PRECISION * step},
    )
    cycle = float(best.x)
    return cycle if np.max(apart(cycle)) <= _SAME else None


def _over(system: ErrorSystem, cycle: float, unit: str) -> ErrorSystem:
    """The last period of the run, which begins anew at its end."""
    from scipy.interpolate import CubicSpline

    step = system.times[1] - system.times[0]
    times = np.linspace(system.times[-1] - cycle, system.times[-1], max(int(np.ceil(cycle / step)), _POINTS) + 1)
    known = system.times >= times[0] - 5 * step
    parts = {}
    for name in ("A0", "E", "H", "K0", "K"):
        parts[name] = CubicSpline(system.times[known], getattr(system, name)[known])(times)
        parts[name][-1] = parts[name][0]
    where = f"along an orbit, whose linear error comes round after {cycle:.4g} {unit}".rstrip()
    return replace(system, times=times, cycle=cycle, where=where, **parts)
