"""Controlled steps side by side: every lane has the bits of its member alone, whatever becomes of the others."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from test_control_of_steps import of_rates, over
from test_program import BOUND, END, plan, program, start_of, system, whole

from hgorun.engine.ensemble import Ensemble
from hgorun.engine.loose_adaptive import controllable
from hgorun.engine.many import Control
from hgorun.engine.member_numbers import MemberNumbers, Outcome
from hgorun.engine.memory import Start, Tolerance
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program, TooManySteps
from hgorun.errors import PlantDiverged, SimulationError

NOTHING = np.zeros(0)
TIGHT = Tolerance(rtol=1e-7, atol=None, max_step=0.3, first_step=0.3)
GIVEN = Tolerance(rtol=1e-5, atol=1e-7, max_step=0.15, first_step=1e-3)


@pytest.mark.costly
@pytest.mark.parametrize(("method", "tolerance"), [("dopri5", TIGHT), ("rodas5p", GIVEN)])
def test_lanes_with_plans_of_their_own_are_runs_of_their_own(method: str, tolerance: Tolerance) -> None:
    """Bit for bit, with all actions, jumps, regimes, rejected steps, and observers that diverge."""
    grid = np.sort(np.concatenate([[0.0, END], np.random.default_rng(1).uniform(0, END, 60)]))
    plans = [replace(whole(plan(seed)), grid=grid) for seed in range(13)]
    z, p = (np.column_stack(numbers) for numbers in zip(*(start_of(seed) for seed in range(13)), strict=True))
    members = MemberNumbers(z0=z, p=p, gain=NOTHING, bias=NOTHING, holds=NOTHING, bound=BOUND)
    assert controllable(system(False))
    control = Control(tolerance=tolerance, limit=100_000)
    found = Ensemble(system(False), method, 8).run_each(plans, members, rows=True, control=control)
    assert found.rows is not None
    assert np.all(np.isposinf(found.plant_diverged))
    diverged = 0
    for k, own in enumerate(plans):
        alone = program(method, adaptive=True).run(own, Start(z[:, [k]], p[:, [k]], BOUND), tolerance)
        np.testing.assert_array_equal(found.rows[..., k], alone.rows[..., 0])
        np.testing.assert_array_equal(found.diverged[:, k], alone.diverged[:, 0])
        np.testing.assert_array_equal(found.error[:, k], alone.error[:, 0])
        assert found.tries[k] == alone.tries
        diverged += int(np.isfinite(alone.diverged).any())
    assert 0 < diverged < len(plans)
    assert len(set(found.tries.tolist())) > 5


def growing(t: ca.SX, z: ca.SX) -> ca.SX:
    """A plant x' = a x^b + cos t and an observer that follows it, where a and b are states that rest."""
    x, a, b, xhat = (z[i] for i in range(4))
    return ca.vertcat(a * ca.fabs(x) ** b + ca.cos(t), 0, 0, -5 * xhat**3 + x)


STARTS = np.array(
    [  # x, a, b, xhat of every member
        [0.5, -1.0, 1.0, 0.0],
        [1.0, 1.0, 2.0, 0.0],  # is infinite at some t < 1
        [0.3, -2.0, 1.0, 1.0],
        [1e290, 900.0, 1.0, 0.0],  # beyond 1e300
        [0.5, -3e5, 1.0, 0.0],  # tens of thousands of steps
        [0.2, -0.1, 2.0, 0.3],
        [np.nan, 0.0, 1.0, 0.0],
        [0.1, 0.5, 1.0, -0.2],
        [0.4, 0.2, 3.0, 0.1],
    ]
).T
SOUND = (0, 2, 5, 7, 8)
LIMIT = 10_000


def together(made: Plan, which: list[int], *, limit: int = LIMIT, threads: int = 1, lanes: int = 8) -> Outcome:
    members = MemberNumbers(
        z0=STARTS[:, which],
        p=np.zeros((0, len(which))),
        gain=NOTHING,
        bias=NOTHING,
        holds=NOTHING,
        bound=(1e300, 0.0),
    )
    control = Control(tolerance=TIGHT, limit=limit)
    return ENSEMBLES[lanes].run(made, members, rows=True, control=control, threads=threads)


ENSEMBLES = {lanes: Ensemble(of_rates(growing, 4, 3), "dopri5", lanes) for lanes in (2, 8, 16)}
MADE = replace(over(1.0), grid=np.linspace(0, 1, 7))


def test_what_fails_in_a_lane_does_not_disturb_the_others() -> None:
    everyone = list(range(STARTS.shape[1]))
    found, sound = together(MADE, everyone), together(MADE, list(SOUND))
    assert found.rows is not None
    assert sound.rows is not None
    np.testing.assert_array_equal(found.rows[..., SOUND], sound.rows)
    np.testing.assert_array_equal(found.tries[list(SOUND)], sound.tries)
    assert [k for k in everyone if np.isposinf(found.plant_diverged[k])] == list(SOUND)


def test_of_a_lane_that_fails_is_known_what_is_known_of_the_member_alone() -> None:
    """A plant that is lost has its time; of what else fails there is no more than that it does."""
    found = together(MADE, list(range(STARTS.shape[1])))
    single = Program(of_rates(growing, 4, 3), "dopri5", adaptive=True)
    for k in range(STARTS.shape[1]):
        start = Start(STARTS[:, [k]], np.zeros((0, 1)), (1e300, 0.0))
        if k in SOUND:
            alone = single.run(MADE, start, TIGHT)
            assert found.rows is not None
            np.testing.assert_array_equal(found.rows[..., k], alone.rows[..., 0])
            assert found.tries[k] == alone.tries
        elif np.isfinite(found.plant_diverged[k]):
            with pytest.raises(PlantDiverged) as lost:
                single.run(MADE, start, TIGHT)
            assert found.plant_diverged[k] == lost.value.at
        else:
            with pytest.raises((SimulationError, TooManySteps)):
                single.run(MADE, start, TIGHT, limit=LIMIT)
    assert np.isfinite(found.plant_diverged[3])
    assert np.isneginf(found.plant_diverged[4])
    assert found.tries[4] == LIMIT


def test_the_limit_is_the_number_of_steps_that_may_be_tried() -> None:
    needed = together(MADE, [0, 2]).tries
    assert needed[0] != needed[1]
    enough = int(min(needed))
    found = together(MADE, [0, 2], limit=enough)
    assert list(np.isneginf(found.plant_diverged)) == list(needed > enough)
    assert np.all(found.tries == enough)


def test_two_threads_give_the_numbers_of_one() -> None:
    which = [*SOUND * 5, 4]
    one, two = together(MADE, which), together(MADE, which, threads=2)
    assert one.rows is not None
    assert two.rows is not None
    np.testing.assert_array_equal(one.rows[..., :-1], two.rows[..., :-1])
    np.testing.assert_array_equal(one.tries, two.tries)


@pytest.mark.parametrize("lanes", [2, 16])
def test_the_number_of_lanes_changes_nothing(lanes: int) -> None:
    everyone = list(range(STARTS.shape[1]))
    eight, other = together(MADE, everyone), together(MADE, everyone, lanes=lanes)
    assert eight.rows is not None
    assert other.rows is not None
    np.testing.assert_array_equal(eight.rows[..., SOUND], other.rows[..., SOUND])
    np.testing.assert_array_equal(eight.tries, other.tries)
    np.testing.assert_array_equal(eight.plant_diverged, other.plant_diverged)
