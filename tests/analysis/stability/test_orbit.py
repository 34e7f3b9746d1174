"""Limits along an orbit do not depend on how long it was followed; along other runs they are told to be of this run."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, findings, inline
from scipy.integrate import solve_ivp

import hgorun
from hgorun.analysis.linear.error_system import ErrorSystem, error_system
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.stability.growth import growth
from hgorun.analysis.stability.orbit import on_orbit
from hgorun.simulation.simulate import prepare
from hgorun.tables.advice import advice

CIRCLING: Block = inline({"a": "b", "b": "1.2*(1 - a**2)*b - 1.5*a"}, "a", 1.5)
EXTENDED: Block = {"type": "extended", "theta": 1.5}


def system(end: float, plant: Block = CIRCLING) -> ErrorSystem:
    run = prepare(experiment(plant, {"o": EXTENDED}, end=end, step=0.02, measurement={"sampling": {"period": 0.05}}))
    return on_orbit(error_system(run, "o", nominal(run)), "s")


def half_a_turn() -> float:
    """Of the plant: its slopes, as even functions of the state, come round twice a turn."""

    def turned(t: float, x: np.ndarray) -> float:
        return float(x[1])

    def rates(t: float, x: np.ndarray) -> list[float]:
        return [x[1], 1.2 * (1 - x[0] ** 2) * x[1] - 1.5 * x[0]]

    found = solve_ivp(rates, (0, 60), [1.5, 0], rtol=1e-10, atol=1e-11, events=turned)
    return float(found.t_events[0][-1] - found.t_events[0][-2])


def test_growth_along_an_orbit() -> None:
    """Lyapunov exponents of the sampled error, integrated apart over 130 periods."""
    found = system(14.0)
    assert found.cycle == pytest.approx(half_a_turn(), rel=1e-4)
    assert "along an orbit, whose linear error comes round after 2.714 s" in found.where
    for period, rate in ((3.7, -0.0949), (3.8, -0.0337), (4.2, 0.0625)):
        assert growth(found, period) == pytest.approx(rate, abs=0.012)


def test_growth_does_not_depend_on_how_long_the_run_is() -> None:
    short, long = system(14.0), system(41.0)
    for period, delay in ((0.05, 0.9), (0.05, 1.1), (1.7, 0.0)):
        assert growth(short, period, delay) == pytest.approx(growth(long, period, delay), abs=3e-3)


@pytest.mark.parametrize("force", ["cos(2*t) + cos(0.731*t)", "2*exp(-t/9)"])
def test_growth_over_a_run_that_does_not_come_round_is_told_to_be_of_this_run(force: str) -> None:
    plant = inline({"a": "b", "b": f"-sin(a)*3 + {force}"}, "a")
    made = experiment(plant, {"o": EXTENDED}, end=12, step=0.02, measurement={"sampling": {"period": 0.1}})
    analysis = hgorun.analyze(made, [one for one in findings("stability") if one.name == "delay_critical"])
    assert "neither at rest nor periodic: over a longer run it may be another" in analysis.observers["o"].remarks[0]
    text = " ".join("\n".join(advice(analysis)).split())
    assert "no delay: over this run, which is neither at rest nor periodic, the linear error grows from" in text
    assert "; over a longer run that may be another" in text
