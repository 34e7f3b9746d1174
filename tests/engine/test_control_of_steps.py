"""Steps under control: what a rejected one leaves, how often Python looks, what is hopeless, and when a run ended."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from interpreter import Interpreter, Step
from test_program import BOUND, plan, program, start_of, system, whole

from hgorun.engine import program as engine
from hgorun.engine.layout import Held, HybridSystem, Regime
from hgorun.engine.memory import Raw, Start, Tolerance
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program, TooManySteps
from hgorun.errors import PlantDiverged, SimulationError

TIGHT = Tolerance(rtol=1e-8, atol=1e-9, max_step=0.2, first_step=0.2)
LOOSE = Tolerance(rtol=1e-6, atol=1e-6, max_step=1.0, first_step=1e-3)
Rates = Callable[[ca.SX, ca.SX], ca.SX]


class Counting(Interpreter):
    """The oracle, which counts the steps that it tries."""

    tries = 0

    def step(self, *arguments: Any) -> Step:
        self.tries += 1
        return super().step(*arguments)


@pytest.mark.costly
@pytest.mark.parametrize("seed", range(3))
def test_a_rejected_step_leaves_nothing_behind(seed: int) -> None:
    """A first step that is far too long is tried again, from the same state and slope."""
    made = whole(plan(seed))
    z, p = start_of(seed)
    found = program("dopri5", adaptive=True).run(made, Start(z[:, None], p[:, None], BOUND), TIGHT)
    oracle = Counting(system(False), made, "dopri5", z, p, BOUND)
    expected = oracle.adaptive(TIGHT)
    assert found.tries == oracle.tries > expected.steps + 2
    np.testing.assert_allclose(found.rows[:, :, 0], expected.rows, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.diverged[:, 0], expected.diverged, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_a_rejected_step_leaves_nothing_in_the_history(seed: int) -> None:
    """Delays repeat every event, where steps are tried again; what observers heard late is what fixed steps tell."""
    made, finer = whole(plan(seed)), whole(plan(seed))
    finer.counts[:, 0] *= 100
    finer.counts[:, 2] = finer.counts[:, 0]
    z, p = start_of(seed)
    start = Start(z[:, None], p[:, None], (1e300, 0.0))
    found = program("dopri5", delayed=True, adaptive=True).run(made, start, TIGHT)
    expected = program("rk4", delayed=True).run(finer, start)
    assert found.tries > 200
    np.testing.assert_allclose(found.rows, expected.rows, rtol=1e-3, atol=1e-3)


def of_rates(rates: Rates, states: int, plant_states: int) -> HybridSystem:
    """A system z' = rates(t, z) without outputs; every state behind the plant's is an observer."""
    observers = states - plant_states
    held = Held(0, observers)
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p", 0), ca.SX.sym("z", states), ca.SX.sym("w", held.size)
    nothing = ca.Function("nothing", [t, p, z, w], [ca.SX(0, 1)])
    blocks = tuple((plant_states + j, plant_states + j + 1, plant_states + j + 1) for j in range(observers))
    flow = ca.Function("flow", [t, p, z, w], [ca.densify(rates(t, z))])
    return HybridSystem(states, plant_states, 0, held, blocks, (), (Regime(flow),), nothing, nothing)


def over(end: float, steps: int = 1, reach: float = 0.0) -> Plan:
    """One segment from 0 to a time, with rows at both."""
    empty = np.zeros(0)
    return Plan(
        spans=np.array([[0.0, end, 0.0, end]]),
        counts=np.array([[steps, 0, steps, 0, 0, 0, 1]], dtype=np.int64),
        actions=np.zeros((0, 5), dtype=np.int64),
        grid=np.array([0.0, end]),
        slots=0,
        gain=empty,
        bias=empty,
        holds=empty,
        reach=reach,
    )


def carried_out(rates: Rates, z0: list[float], plant_states: int, *, limit: float = np.inf) -> Raw:
    """From 0 to 1, with dopri5 and a loose tolerance."""
    compiled = Program(of_rates(rates, len(z0), plant_states), "dopri5", adaptive=True)
    start = Start(np.array(z0)[:, None], np.zeros((0, 1)))
    return compiled.run(over(1.0), start, LOOSE, limit=limit)


def oscillator(t: ca.SX, z: ca.SX) -> ca.SX:
    return ca.vertcat(30 * z[1], -30 * z[0])


def test_how_often_python_looks_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for budget in (1, 3, 20_000):
        monkeypatch.setattr(engine, "_BUDGET", budget)
        found.append(carried_out(oscillator, [1.0, 0.0], 2))
    assert len({raw.tries for raw in found}) == 1
    assert found[0].tries > 50
    for raw in found[1:]:
        np.testing.assert_array_equal(raw.rows, found[0].rows)
        np.testing.assert_array_equal(raw.error, found[0].error)
    np.testing.assert_allclose(found[0].rows[-1, :, 0], [np.cos(30), -np.sin(30)], atol=1e-3)


@pytest.mark.parametrize("budget", [1, 7, 20_000])
def test_the_limit_is_the_number_of_steps_that_may_be_tried(budget: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_BUDGET", budget)
    needed = carried_out(oscillator, [1.0, 0.0], 2)
    again = carried_out(oscillator, [1.0, 0.0], 2, limit=needed.tries)
    np.testing.assert_array_equal(again.rows, needed.rows)
    with pytest.raises(TooManySteps) as stopped:
        carried_out(oscillator, [1.0, 0.0], 2, limit=needed.tries - 1)
    tries, reached = stopped.value.args
    assert tries == needed.tries - 1
    assert 0.5 < reached < 1.0


def following(rate: float, t: ca.SX, z: ca.SX) -> ca.SX:
    """z follows cos t; explicit steps cannot be longer than about 3.3 / rate."""
    return -rate * (z - ca.cos(t))


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """400 steps have to bring a thousandth of the run, where it takes a million elsewhere."""
    monkeypatch.setattr(engine, "PATIENCE", 400)
    monkeypatch.setattr(engine, "_BUDGET", 50)


@pytest.mark.usefixtures("impatient")
def test_an_observer_whose_steps_are_hopeless_is_given_up_and_no_other() -> None:
    """Steps of 1e-8 from t = 0.2 on; until then those of 1e-5, of which 400 bring more than a thousandth."""

    def rates(t: ca.SX, z: ca.SX) -> ca.SX:
        hard = following(3e5, t, z[2]) * ca.if_else(t < 0.2, 1, 1e3)
        return ca.vertcat(-z[0], -2 * z[1], hard)

    raw = carried_out(rates, [1.0, 1.0, 0.0], 1, limit=100_000)
    assert raw.diverged[0, 0] == np.inf
    assert raw.diverged[1, 0] == pytest.approx(0.2, abs=2e-3)
    np.testing.assert_allclose(raw.rows[-1, :2, 0], [np.exp(-1), np.exp(-2)], rtol=1e-5)
    assert np.isnan(raw.rows[-1, 2, 0])


@pytest.mark.usefixtures("impatient")
def test_slow_steps_that_come_forward_are_not_hopeless() -> None:
    """Steps of 1e-5 bring four thousandths in 400 of them, although 50 bring less than one."""
    raw = carried_out(lambda t, z: ca.vertcat(-z[0], following(3e5, t, z[1])), [1.0, 0.0], 1, limit=500_000)
    assert raw.tries > 50_000
    assert raw.diverged[0, 0] == np.inf
    np.testing.assert_allclose(raw.rows[-1, :, 0], [np.exp(-1), np.cos(1)], rtol=1e-4)


@pytest.mark.usefixtures("impatient")
def test_a_plant_whose_steps_are_hopeless_ends_the_run() -> None:
    with pytest.raises(SimulationError, match=r"no step is small enough for the plant at t = \S+e-0[67]:"):
        carried_out(lambda t, z: ca.vertcat(following(3e9, t, z[0]), -z[1]), [0.0, 1.0], 1, limit=100_000)


@pytest.mark.parametrize(("growth", "step"), [(1e4, 0.01), (3e6, 0.25)])
def test_a_run_of_fixed_steps_ends_with_the_step_in_which_the_plant_is_lost(growth: float, step: float) -> None:
    """Euler's method: every step multiplies x by 1 + growth * step, until it is beyond 1e300."""
    steps = round(40 / step)
    compiled = Program(of_rates(lambda t, z: growth * z, 1, 1), "euler")
    x, k = 1.0, 0
    while abs(x) <= 1e300:
        x, k = x + step * (growth * x), k + 1
    with pytest.raises(PlantDiverged) as ended:
        compiled.run(over(40.0, steps), Start(np.ones((1, 1)), np.zeros((0, 1))))
    assert k > 10
    assert ended.value.at == pytest.approx(k * step, rel=1e-12)


def test_a_delay_that_is_longer_than_what_is_kept_ends_the_run_in_the_step_that_asks_for_it() -> None:
    """A delay of 0.355 where a reach of 0 keeps a few steps of 0.01: what is late is known until t = 0.355."""
    t, p, z, slope = ca.SX.sym("t"), ca.SX.sym("p", 0), ca.SX.sym("z", 1), ca.SX.sym("slope", 1)
    held = Held(1, 0)
    w = ca.SX.sym("w", held.size)
    arguments = [t, p, z, w]
    late = Regime(
        ca.Function("flow", arguments, [-w[held.output(0)]]), ca.Function("lag", arguments, [ca.SX(0.355)]), (0,)
    )
    channels = ca.Function("channels", arguments, [z[0]])
    slopes = ca.Function("slopes", [t, p, z, slope], [ca.vertcat(z[0], slope[0])])
    compiled = Program(HybridSystem(1, 1, 0, held, (), (), (late,), channels, slopes), "rk4")
    with pytest.raises(SimulationError, match=r"the delay at t = 0\.35 reaches further back"):
        compiled.run(over(1.0, 100), Start(np.ones((1, 1)), np.zeros((0, 1))))
