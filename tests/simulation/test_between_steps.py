"""What is narrow in a state, and jumps where a state passes a value, with default steps against pieces by scipy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from examples import experiment, inline
from scipy.integrate import solve_ivp

from hgorun import Experiment, Result, simulate

END, START, ESTIMATE, THETA = 10.0, (2.0, 0.0), (1.9, 0.1), 2.0
NARROW, FORCE = 1e-4, 2000.0
BAND = f"{FORCE}*(x1 > {1 - NARROW})*(x1 < {1 + NARROW})"


def oscillator(force: str, **more: Any) -> Experiment:
    """x1' = x2, x2' = -x1 + force, with a standard observer."""
    initial: dict[str, float] = dict(zip(("x1", "x2"), START, strict=True))
    plant = inline({"x1": "x2", "x2": f"-x1 + {force}"}, "x1", initial=initial)
    observer = {"type": "shgo", "theta": THETA, "initial": dict(zip(("x1", "x2"), ESTIMATE, strict=True))}
    return experiment(plant, {"S": observer}, end=END, output_step=0.1, **more)


def in_pieces(
    force: Callable[[float, float, Sequence[bool]], float], switches: Sequence[Callable[[float, float], float]]
) -> np.ndarray:
    """(x, xhat) on the grid; ``force(x1, x2, above)`` is smooth while no switch changes its sign."""
    grid = np.arange(101) * 0.1
    count, z, t = len(switches), np.array([*START, *ESTIMATE]), 0.0
    where = [(own, g) for own in (0, 2) for g in switches]
    above = [bool(g(*z[own : own + 2]) > 0) for own, g in where]
    rows = np.zeros((grid.size, 4))
    rows[0] = z

    def flow(_: float, z: np.ndarray) -> list[float]:
        e = z[2] - z[0]
        own, copy = (force(z[k], z[k + 1], above[j : j + count]) for k, j in ((0, 0), (2, count)))
        return [z[1], -z[0] + own, z[3] - 2 * THETA * e, -z[2] + copy - THETA**2 * e]

    while t < END:
        events = []
        for (own, g), high in zip(where, above, strict=True):

            def event(_: float, z: np.ndarray, own: int = own, g: Any = g, high: bool = high) -> float:
                return float(g(*z[own : own + 2])) + (1e-13 if high else -1e-13)  # not again where it was

            event.terminal, event.direction = True, -1 if high else 1  # type: ignore[attr-defined]  # scipy's way
            events.append(event)
        within = any(above[k] != above[k + 1] for k in range(0, 2 * count, count) if count > 1)
        longest = 0.1 * NARROW if within else 0.05  # scipy sees one change of a sign in a step
        piece = solve_ivp(
            flow,
            (t, END),
            z,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            events=events,
            dense_output=True,
            max_step=longest,
        )
        inside = (grid > t) & (grid <= piece.t[-1])
        if inside.any():
            rows[inside] = piece.sol(grid[inside]).T
        t, z = float(piece.t[-1]), piece.y[:, -1]
        for k, times in enumerate(piece.t_events):
            if times.size:
                above[k] = not above[k]
    return rows


def sizes(e: np.ndarray) -> np.ndarray:
    """Of errors from a third of the run on: root mean square and largest value."""
    steady = e[34:]
    return np.array([np.sqrt((steady**2).mean(axis=0)), np.abs(steady).max(axis=0)])


def assert_right(result: Result, rows: np.ndarray) -> None:
    observer = result.observers["S"]
    assert result.status == "ok"
    assert np.allclose(result.x, rows[:, :2], atol=1e-3 * np.abs(rows[:, :2]).max())
    assert np.allclose(observer.xhat, rows[:, 2:], atol=1e-3 * np.abs(rows[:, 2:]).max())
    assert np.allclose(sizes(observer.xhat - result.x), sizes(rows[:, 2:] - rows[:, :2]), rtol=1e-3)


@pytest.mark.costly
def test_a_force_in_a_narrow_band_of_positions() -> None:
    """It lasts a ten-thousandth of a second, and whether the next one is met depends on the one before."""
    rows = in_pieces(
        lambda x1, x2, above: FORCE * (above[0] and not above[1]),
        [lambda x1, x2: x1 - (1 - NARROW), lambda x1, x2: x1 - (1 + NARROW)],
    )
    assert_right(simulate(oscillator(BAND)), rows)


def test_friction_of_which_the_observer_has_a_copy() -> None:
    """Both change sign within one step: what matters to the error is which of them does so first, and by how much."""
    rows = in_pieces(lambda x1, x2, above: -0.1 if above[0] else 0.1, [lambda x1, x2: x2])
    result = simulate(oscillator("-0.1*sign(x2)"))
    assert result.x[-1, 0] == pytest.approx(-0.1 - 1.3 * np.cos(END - 3 * np.pi), rel=1e-4)
    assert_right(result, rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    "force",
    [
        f"where(abs(x1 - 1) < {NARROW}, {FORCE}, 0)",
        f"{FORCE}*exp(-((x1 - 1)/{NARROW})**2)",
        f"{FORCE}/(1 + ((x1 - 1)/{NARROW})**2)",
        f"{FORCE}*max(0, 1 - abs(x1 - 1)/{NARROW})",
        f"{FORCE / 2}*(tanh((x1 - {1 - NARROW})/1e-5) - tanh((x1 - {1 + NARROW})/1e-5))",
        f"{FORCE}*exp(-((x1 - cos(t))/{NARROW})**2)",
        f"{FORCE}*(1 - (x1 - 1)**2/4)**100000000",
    ],
)
def test_narrow_features_of_other_forms(force: str) -> None:
    found = simulate(oscillator(force))
    exact = simulate(oscillator(force, solver={"method": "dopri5", "rtol": 1e-9, "max_step": 5e-5}))
    free = simulate(oscillator("0"))
    assert np.abs(exact.x - free.x).max() > 1e-2  # it matters
    assert found.status == "ok"
    assert np.allclose(found.x, exact.x, atol=2e-3)
    assert found.metrics()["S"]["sup"]["x2"] == pytest.approx(exact.metrics()["S"]["sup"]["x2"], rel=1e-3)


def test_a_motor_that_starts_at_rest_does_not_pass_its_friction() -> None:
    """At rest the friction is at its narrow place, which the first moment leaves; a shorter given step agrees."""
    dynamics = {"a": "v", "v": "500*c - v - 200*tanh(v/0.1)", "c": "100*(6*sin(2*t) - c - 0.05*v)"}
    observers = {"o": {"type": "fhgo2", "theta": 30, "r": 2, "initial": {"a": 0.5}}}
    noisy = {"sampling": {"period": 0.005}, "noise": [{"type": "gaussian", "std": 0.01}]}
    found = simulate(experiment(inline(dynamics, "a", 0.0), observers, end=5, output_step=0.005, measurement=noisy))
    assert found.status == "ok"


def test_what_cannot_be_followed_is_said() -> None:
    """A hundred thousand levels a second, one of which acts."""
    result = simulate(oscillator("2000*(floor(x1*1e5) == 100000)"))
    assert result.status == "inaccurate"
    assert result.verdict.reason is not None
    assert "too many jumps" in result.verdict.reason
    assert "tanh(s/eps)" in result.verdict.reason  # what to do


@pytest.mark.costly
def test_with_a_chosen_method_it_is_met_or_said() -> None:
    result = simulate(oscillator(BAND, solver={"method": "rk4"}))
    exact = simulate(oscillator(BAND, solver={"method": "dopri5", "rtol": 1e-9, "max_step": 5e-5}))
    assert result.status != "ok" or np.allclose(result.x, exact.x, atol=2e-3)


@pytest.mark.costly
@pytest.mark.parametrize("force", ["-0.1*x2", "-max(min(x2, 0.1), -0.1)", "-x1**3/(1 + x1**2)", "-0.1*tanh(x2)"])
def test_what_is_not_narrow_takes_no_other_steps(force: str) -> None:
    result = simulate(oscillator(force))
    assert result.integration is not None
    assert result.integration.method == "rk4"
