"""Plants that reach infinity in finite time: the run ends with that time, whatever the steps would have made of it."""

from __future__ import annotations

import pytest
from examples import Block, inline, simulated

from hgorun.errors import SimulationError

SHGO: Block = {"O": {"type": "shgo", "theta": 2, "initial": {"x": 1}}}
RUN: Block = {"start": 5, "end": 9, "output_step": 0.1}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "start", "at", "solver"),
    [
        ("x**2", 1.0, 1.0, {}),
        ("x**2", 1.0, 1.0, {"step": 0.1}),
        ("x**2", 1.0, 1.0, {"method": "dopri5"}),
        ("1e9*x**3", 1e-6, 500.0, {}),
        ("1 + x**2", 0.0, 1.5708, {}),
        ("exp(x)", 0.0, 1.0, {}),
    ],
)
def test_the_plant_has_diverged_when_it_reaches_infinity(rate: str, start: float, at: float, solver: Block) -> None:
    """1/(1 - t), (1 - 2 a t)^(-1/2), tan t and -log(1 - t)."""
    run = {"start": 5, "end": 5 + 4 * at, "output_step": at / 10}
    with pytest.raises(SimulationError, match=rf"diverged at t = {5 + at:.6g}, where x reaches infinity"):
        simulated(inline({"x": rate}, "x", start), SHGO, time=run, solver=solver)


def test_a_plant_that_is_singular_where_it_stays_finite_has_not_diverged() -> None:
    with pytest.raises(SimulationError, match=r"no step is small enough for the plant at t = 5\.5"):
        simulated(inline({"x": "-1/x"}, "x", 1.0), SHGO, time=RUN, solver={"method": "dopri5"})


@pytest.mark.costly
@pytest.mark.parametrize("solver", [{}, {"method": "dopri5"}, {"step": 0.01}], ids=["auto", "dopri5", "given"])
def test_a_level_that_falls_below_zero_under_a_root_is_named(solver: Block) -> None:
    """x' = -1 - sqrt(x) reaches 0 at 2 - 2 log 2 = 0.6137, with all steps."""
    words = r"cannot be followed beyond t = 5\.61\d*: sqrt of a negative number \(x = -.*as in sqrt\(max\(x, 0\)\)"
    with pytest.raises(SimulationError, match=words):
        simulated(inline({"x": "-1 - sqrt(x)"}, "x", 1.0), SHGO, time=RUN, solver=solver)


def test_a_plant_that_overflows_has_diverged_though_long_steps_stay_behind() -> None:
    """exp(300 t) leaves the doubles at t = 2.37; with four steps until t = 3 it would be 3e+26."""
    with pytest.raises(SimulationError, match=r"the plant itself diverged at t = 2\.3"):
        simulated(inline({"x": "300*x"}, "x", 1.0), SHGO, time={"end": 3, "output_step": 0.05})
