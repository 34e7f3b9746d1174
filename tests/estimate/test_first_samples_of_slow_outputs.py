"""Outliers among the first samples of an output that is measured far less often than another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import inline
from recordings import assessed_of, recording, signal, source
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from hgorun.data.recording import FirstSamples
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate

TIMES, SLOW = np.arange(0.0, 601.0), 60
STD = {"T": 0.2, "c": 0.05}


def gated(
    outliers: dict[int, float], *, coupling: float, rate: float = -0.002, first_samples: FirstSamples = 1, seed: int = 2
) -> tuple[float, float]:
    """Samples of c that are left out, and the error of its estimate; T and c have the modes -0.02 and -0.002.

    ``outliers`` are of c, by number, ``rate`` is that of the model.
    """
    c = 4 * np.exp(-0.002 * TIMES)
    forced = coupling * 4 / 0.018  # of T - 20, with the mode of c
    warm = 20 + forced * np.exp(-0.002 * TIMES) + (40 - forced) * np.exp(-0.02 * TIMES)
    random = np.random.default_rng(seed)
    taken = np.arange(0, TIMES.size, SLOW)
    y = c[taken] + STD["c"] * random.standard_normal(taken.size)
    for k, far in outliers.items():
        y[k] += far
    z = warm + STD["T"] * random.standard_normal(TIMES.size)
    plant = inline({"T": f"-0.02*(T - 20) + {coupling}*c", "c": f"{rate}*c"}, {"z": "T", "y": "c"})
    del plant["initial"]
    outputs = signal("z", TIMES, z, gate=5.0, std=STD["T"]), signal("y", TIMES[taken], y, gate=5.0, std=STD["c"])
    log = replace(recording(*outputs), first_samples=first_samples)
    config = {
        "time": {"start": 0.0, "end": 600.0},
        "plant": plant,
        "observers": {"F": {"type": "ekf", "Q": {"T": 1e-3, "c": 1e-6}, "internal": {"P": [[0.04, 0], [0, 0.0025]]}}},
    }
    found = estimate(source(config), log, sensitivity=False)
    error = np.sqrt(np.mean((found.observers["F"].xhat[:, 1] - np.interp(found.time, TIMES, c)) ** 2))
    return float(assessed_of(found, "F").scores["gated"]["y"]), float(error)


@pytest.mark.parametrize("coupling", [0.0, 0.5])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_an_outlier_of_a_slow_output_is_left_out(coupling: float, which: int) -> None:
    """No other sample is near it; from such a start a filter left out all good ones that came."""
    count, error = gated({which: 4.0}, coupling=coupling)
    assert count == 1
    assert error < 0.03


def swing(t: float, x: np.ndarray) -> list[float]:
    """Two pendula with a spring between them."""
    a, b, c, d = x
    return [b, -20 * np.sin(a) - 0.1 * b + 5 * (c - a), d, -30 * np.sin(c) + 5 * (a - c) - 0.1 * d]


@pytest.mark.parametrize("first_samples", [pytest.param(3, marks=pytest.mark.slow), "auto"])
def test_the_start_of_swings_between_slow_samples_is_the_nearest_one(first_samples: FirstSamples) -> None:
    """Ten swings lie between two samples of c: what is found is what other least squares of other solutions find."""
    fast, random = np.arange(0, 300) / 16, np.random.default_rng(7)
    x = solve_ivp(swing, (0, 19), [1.0, 0.0, 0.5, 0.0], t_eval=fast, rtol=1e-9, atol=1e-9).y
    y, z = (x[k] + 0.02 * random.standard_normal(fast.size) for k in (0, 2))
    log = replace(
        recording(signal("y", fast, y, std=0.02), signal("z", fast[::100], z[::100], std=0.02)),
        first_samples=first_samples,
    )
    dynamics = {"a": "b", "b": "-20*sin(a) - 0.1*b + 5*(c - a)", "c": "d", "d": "-30*sin(c) + 5*(a - c) - 0.1*d"}
    plant = inline(dynamics, {"y": "a", "z": "c"})
    del plant["initial"]
    config = {"time": {"start": 0.0, "end": 18.0}, "plant": plant, "observers": {"S": {"type": "shgo", "theta": 2}}}
    found = completed(source(config), log, "start", "").observers["S"].initial
    start = np.array([found[name] for name in "abcd"])
    if first_samples == "auto":  # the noise of the fast ones, and the first of the slow ones
        np.testing.assert_allclose(start[[0, 2]], [1.0, 0.5], atol=0.06)
        return

    def errors(start: np.ndarray) -> np.ndarray:
        way = solve_ivp(swing, (0, 19), start, "DOP853", [*fast[:3], *fast[100:300:100]], rtol=1e-8, atol=1e-8).y
        return np.concatenate([way[0, :3] - y[:3], way[2, [0, 3, 4]] - z[::100]]) / 0.02

    nearest = least_squares(errors, [y[0], 0.0, z[0], 0.0], x_scale=[0.02, 0.1, 0.02, 0.1], xtol=1e-10, ftol=1e-10).x
    np.testing.assert_allclose(start, nearest, atol=0.01)
