"""Compiled programs against the plain interpreter of their tables: random plans, all actions, lanes, masks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from interpreter import Interpreter, Run

from hgorun.engine.ensemble import Ensemble
from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, SET, TAKE, Held, HybridSystem, Regime
from hgorun.engine.loose import fits
from hgorun.engine.member_numbers import MemberNumbers
from hgorun.engine.memory import Raw, Start, Tolerance
from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program
from hgorun.errors import PlantDiverged, SimulationError

Array = npt.NDArray[np.float64]
PLANT, OBSERVERS, OUTPUTS, PARAMETERS = 2, 2, 2, 2
OWN = 2 + OUTPUTS  # states of an observer, then its alphas
STATES = PLANT + OBSERVERS * OWN
LAYOUT = Held(OUTPUTS, OBSERVERS)
END = 2.0
BOUND = (5.0, 1.5)
SILENT, CONTINUOUS, HELD, DELAYED = "silent", "continuous", "held", "delayed"
KINDS = {  # what the two outputs are to the observers
    False: [(SILENT, CONTINUOUS), (CONTINUOUS, HELD), (HELD, HELD)],
    True: [(SILENT, HELD), (DELAYED, HELD), (DELAYED, DELAYED)],
}


def block(j: int) -> slice:
    """Where an observer's own states and alphas are in z."""
    return slice(PLANT + j * OWN, PLANT + (j + 1) * OWN)


def heard(w: ca.SX, kinds: tuple[str, str], j: int) -> ca.SX:
    """What reaches observer j: the noise of each output, and what has been measured where that is told."""
    parts = []
    for i, kind in enumerate(kinds):
        parts.append(w[LAYOUT.noise(i)])
        if kind in (HELD, DELAYED):
            parts += [w[LAYOUT.output(i)], w[LAYOUT.s(i, j)]]
        if kind == HELD:
            parts += [w[LAYOUT.previous(i)], w[LAYOUT.interval]]
    return ca.vertcat(*parts)


@cache
def system(delayed: bool) -> HybridSystem:
    """Random coefficients; an observer knows the plant and itself, the plant only itself and time."""
    rng = np.random.default_rng(7)
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p", PARAMETERS), ca.SX.sym("z", STATES), ca.SX.sym("w", LAYOUT.size)
    x = z[:PLANT]

    def matrix(rows: int, columns: int, scale: float = 1.0) -> ca.DM:
        return ca.DM(scale * rng.normal(size=(rows, columns)))

    def regime(kinds: tuple[str, str]) -> Regime:
        rates = [ca.DM([[-0.3, 1.5], [-1.5, 0.1]]) @ x + ca.vertcat(ca.sin(9 * t), p[0] * ca.cos(t))]
        for j in range(OBSERVERS):
            own, told = z[block(j)], heard(w, kinds, j)
            pull = ca.tanh(matrix(OWN, told.numel()) @ told) + matrix(OWN, PLANT) @ x
            rates.append(matrix(OWN, OWN, 0.4) @ own + 5 * p[1] * j * own + pull + ca.sin(5 * t))
        flow = ca.Function("flow", [t, p, z, w], [ca.vertcat(*rates)])
        late = tuple(i for i, kind in enumerate(kinds) if kind == DELAYED)
        lag = ca.vertcat(0.35 + 0.1 * ca.sin(3 * t), 0.45 - 0.1 * ca.cos(t))
        return Regime(flow, ca.Function("lag", [t, p, z, w], [lag]) if late else None, late)

    def channels() -> ca.SX:
        found = []
        for i in range(OUTPUTS):
            found.append(x[i] * p[0] + ca.sin(x[1 - i]) + t * w[LAYOUT.noise(i)])
            found += [z[block(j)][0] - z[block(j)][2 + i] for j in range(OBSERVERS)]
        return ca.vertcat(*found)

    slope = ca.SX.sym("slope", STATES)
    smooth = ca.substitute(channels(), w, ca.SX.zeros(LAYOUT.size))  # a history is of what is smooth
    jumps = [(0, PLANT, ca.vertcat(x[1], -0.5 * x[0] + w[0]))]
    own = z[block(1)]
    jumps.append((block(1).start, block(1).stop, ca.vertcat(own[1], own[0], 0, 0) + 0.1 * ca.sin(t) + p[0]))
    return HybridSystem(
        states=STATES,
        plant_states=PLANT,
        parameters=PARAMETERS,
        held=LAYOUT,
        blocks=tuple((block(j).start, block(j).start + 2, block(j).stop) for j in range(OBSERVERS)),
        alpha=tuple(tuple(block(j).start + 2 + i for j in range(OBSERVERS)) for i in range(OUTPUTS)),
        regimes=tuple(regime(kinds) for kinds in KINDS[delayed]),
        channels=ca.Function("channels", [t, p, z, w], [channels() if not delayed else smooth]),
        channel_slopes=ca.Function(
            "slopes", [t, p, z, slope], [ca.vertcat(smooth, ca.jacobian(smooth, z) @ slope + ca.jacobian(smooth, t))]
        ),
        jumps=tuple((start, stop, ca.Function("jump", [t, p, z, w], [new])) for start, stop, new in jumps),
    )


def plan(seed: int, *, most_steps: int = 6) -> Plan:
    """Random events with random actions, segments cut into pieces, and rows at events and between."""
    rng = np.random.default_rng(seed)
    events = np.concatenate([[0.0], np.sort(rng.uniform(0.1, END - 0.1, 6)), [END]])
    slots = 5
    spans: list[tuple[float, ...]] = []
    counts: list[tuple[int, ...]] = []
    actions: list[tuple[int, ...]] = []
    for start, end in pairwise(events):
        steps = int(np.ceil((end - start) / 0.2)) + int(rng.integers(0, most_steps))
        cuts = [0, *sorted(rng.choice(np.arange(1, steps), min(2, steps - 1), replace=False)), steps]
        first = len(actions)
        for _ in range(rng.integers(0, 6)):
            op = int(rng.choice([TAKE, ARRIVE, RECORD, SET, REBASE, JUMP, ARRIVE]))
            output, low = int(rng.integers(0, OUTPUTS)), int(rng.integers(0, slots))
            place = LAYOUT.noise(output) if rng.random() < 0.5 else LAYOUT.interval
            where = place if op == SET else output
            actions.append((op, where, int(rng.integers(0, slots)), low, int(rng.integers(low, slots + 1))))
        inward = rng.uniform(0, 1e-3, 2)
        for k, (a, b) in enumerate(pairwise(cuts)):
            spans.append((start, end, start + inward[0], end - inward[1]))
            many = (first, len(actions)) if k == 0 else (len(actions), len(actions))
            regime = int(rng.integers(0, 3)) if k == 0 else counts[-1][3]
            counts.append((steps, a, b, regime, *many, 1))
    grid = np.sort(np.concatenate([[0.0, END, events[2]], rng.uniform(0, END, 30)]))
    return Plan(
        spans=np.array(spans),
        counts=np.array(counts, dtype=np.int64),
        actions=np.array(actions, dtype=np.int64).reshape(-1, 5),
        grid=grid,
        slots=slots,
        gain=rng.uniform(0.5, 1.5, slots),
        bias=rng.normal(size=slots),
        holds=rng.normal(size=slots),
        reach=0.5,
    )


def whole(made: Plan) -> Plan:
    """The same with one piece a segment, as adaptive methods have it."""
    kept = made.counts[:, 1] == 0
    return replace(made, spans=made.spans[kept], counts=made.counts[kept])


@cache
def program(method: str, *, delayed: bool = False, adaptive: bool = False, lanes: int = 1) -> Program:
    return Program(system(delayed), method, adaptive=adaptive, lanes=lanes)


def start_of(seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(1000 + seed)
    return rng.normal(size=STATES), rng.uniform(0.1, 0.6, PARAMETERS)


def assert_same(found: Raw, expected: Run) -> None:
    def close(a: Array, b: Array, scale: float = 1.0) -> None:
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-10 * scale)

    close(found.rows[:, :, 0], np.array(expected.rows), 10)
    close(found.measured[:, 0], expected.measured)
    close(found.diverged[:, 0], expected.diverged)
    close(found.error[:, 0], expected.error)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("method", ["euler", "rk4", "dopri5"])
@pytest.mark.parametrize("delayed", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_fixed_steps(seed: int, delayed: bool, method: str) -> None:
    made = plan(seed)
    z, p = start_of(seed)
    found = program(method, delayed=delayed).run(made, Start(z[:, None], p[:, None], BOUND))
    assert_same(found, Interpreter(system(delayed), made, method, z, p, BOUND).fixed())


def test_some_of_these_observers_diverge_and_some_do_not() -> None:
    times = [Interpreter(system(False), plan(seed), "rk4", *start_of(seed), BOUND).fixed() for seed in range(6)]
    diverged = np.isfinite([run.diverged for run in times])
    assert 0 < diverged.sum() < diverged.size


@pytest.mark.one_in(2)
@pytest.mark.parametrize("seed", range(6))
def test_adaptive_steps(seed: int) -> None:
    made = whole(plan(seed))
    z, p = start_of(seed)
    tolerance = Tolerance(rtol=1e-5, atol=1e-7, max_step=0.15, first_step=1e-3)
    found = program("dopri5", adaptive=True).run(made, Start(z[:, None], p[:, None], BOUND), tolerance)
    expected = Interpreter(system(False), made, "dopri5", z, p, BOUND).adaptive(tolerance)
    assert expected.steps > len(made.spans)
    np.testing.assert_allclose(found.rows[:, :, 0], expected.rows, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(found.measured[:, 0], expected.measured, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(found.error[:, 0], expected.error, rtol=1e-4, atol=1e-10)
    np.testing.assert_allclose(found.diverged[:, 0], expected.diverged, rtol=1e-7)


@pytest.mark.measured("rodas5p-False-8")
@pytest.mark.costly
@pytest.mark.one_in(2)
@pytest.mark.parametrize("lanes", [2, pytest.param(4, marks=pytest.mark.slow), 8])
@pytest.mark.parametrize("delayed", [False, True])
@pytest.mark.parametrize("method", ["rk4", "rodas5p"])
def test_lanes_are_runs_of_their_own(method: str, lanes: int, delayed: bool) -> None:
    """Bit for bit: other states, parameters, noise and gains a lane."""
    made = plan(3)
    rng = np.random.default_rng(lanes)
    z, p = rng.normal(size=(STATES, lanes)), rng.uniform(0.1, 0.6, (PARAMETERS, lanes))
    gain, bias, holds = (rng.normal(size=(made.slots, lanes)) for _ in range(3))
    many = replace(made, gain=gain, bias=bias, holds=holds)
    together = program(method, delayed=delayed, lanes=lanes).run(many, Start(z, p, BOUND))
    for lane in range(lanes):
        one = replace(made, gain=gain[:, lane], bias=bias[:, lane], holds=holds[:, lane])
        alone = program(method, delayed=delayed).run(one, Start(z[:, lane, None], p[:, lane, None], BOUND))
        for name in ("rows", "measured", "diverged", "error"):
            a, b = getattr(together, name)[..., lane], getattr(alone, name)[..., 0]
            np.testing.assert_array_equal(a, b, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("delayed", [False, True])
@pytest.mark.parametrize("method", ["dopri5", "rodas5p"])
def test_lanes_with_error_control_are_as_accurate_as_runs_of_their_own(method: str, delayed: bool) -> None:
    """Side by side they share the steps that the hardest lane needs, and are masked one by one."""
    lanes, made = 4, whole(plan(3))
    rng = np.random.default_rng(5)
    z, p = rng.normal(size=(STATES, lanes)), np.array([[0.1, 0.3, 0.5, 0.6], [0.1, 0.2, 1.0, 4.0]])
    gain, bias, holds = (rng.normal(size=(made.slots, lanes)) for _ in range(3))
    many = replace(made, gain=gain, bias=bias, holds=holds)
    bound, tolerance = (50.0, 20.0), Tolerance(rtol=1e-11, atol=1e-11, max_step=0.1, first_step=1e-3)
    together = program(method, delayed=delayed, adaptive=True, lanes=lanes).run(many, Start(z, p, bound), tolerance)
    assert len(set(np.isfinite(together.diverged[1]))) == 2  # it diverges in some lanes
    for lane in range(lanes):
        one = replace(made, gain=gain[:, lane], bias=bias[:, lane], holds=holds[:, lane])
        start = Start(z[:, lane, None], p[:, lane, None], bound)
        alone = program(method, delayed=delayed, adaptive=True).run(one, start, tolerance)
        np.testing.assert_allclose(together.diverged[:, lane], alone.diverged[:, 0], atol=0.1)
        for name in ("rows", "measured"):
            a, b = getattr(together, name)[..., lane], getattr(alone, name)[..., 0]
            np.testing.assert_array_equal(np.isfinite(a), np.isfinite(b))
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_plant_that_diverges_ends_the_run(adaptive: bool) -> None:
    made = plan(0)
    z, p = start_of(0)
    z[0] = 1e301
    tolerance = Tolerance(1e-5, 1e-7, 1.0, 1e-3) if adaptive else None
    with pytest.raises(SimulationError, match=r"the plant itself diverged at t = \S+: nothing can be said"):
        program("dopri5", adaptive=adaptive).run(
            whole(made) if adaptive else made, Start(z[:, None], p[:, None]), tolerance
        )


def test_progress_grows_to_one() -> None:
    told: list[float] = []
    z, p = start_of(1)
    program("rk4").run(plan(1), Start(z[:, None], p[:, None]), progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert 0 < told[0] < 1


@pytest.mark.costly
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_lanes_with_plans_of_their_own_are_runs_of_their_own(method: str) -> None:
    """Bit for bit, with all actions, jumps, regimes, other numbers of steps, and observers that diverge."""
    grid = np.sort(np.concatenate([[0.0, END], np.random.default_rng(1).uniform(0, END, 60)]))
    plans = [replace(plan(seed, most_steps=2 + 5 * (seed % 3)), grid=grid) for seed in range(13)]
    z, p = (np.column_stack(numbers) for numbers in zip(*(start_of(seed) for seed in range(13)), strict=True))
    nothing = np.zeros(0)
    members = MemberNumbers(z0=z, p=p, gain=nothing, bias=nothing, holds=nothing, bound=BOUND)
    assert fits(system(False), METHODS[method])
    found = Ensemble(system(False), method, 4).run_each(plans, members, rows=True)
    assert found.rows is not None
    diverged = 0
    for k, own in enumerate(plans):
        alone = program(method).run(own, Start(z[:, [k]], p[:, [k]], BOUND))
        np.testing.assert_array_equal(found.rows[..., k], alone.rows[..., 0])
        np.testing.assert_array_equal(found.diverged[:, k], alone.diverged[:, 0])
        np.testing.assert_array_equal(found.last[:, k], alone.rows[-1, :, 0])
        diverged += int(np.isfinite(alone.diverged).any())
    assert 0 < diverged < len(plans)


@pytest.mark.costly
@pytest.mark.parametrize(("delayed", "method"), [(True, "rk4"), (False, "dopri5")])
def test_what_cannot_run_side_by_side_runs_on_threads(delayed: bool, method: str) -> None:
    """Continuous delays and embedded errors with plans of their own, of other numbers of samples."""
    grid = np.linspace(0, END, 11)
    plans = [replace(plan(seed), grid=grid) for seed in range(5)]
    plans[1] = replace(plans[1], holds=np.append(plans[1].holds, [1.0, 2.0]))
    z, p = (np.column_stack(numbers) for numbers in zip(*(start_of(seed) for seed in range(5)), strict=True))
    nothing = np.zeros(0)
    members = MemberNumbers(z0=z, p=p, gain=nothing, bias=nothing, holds=nothing, bound=BOUND)
    assert not fits(system(delayed), METHODS[method])
    found = Ensemble(system(delayed), method).run_each(plans, members, rows=True, threads=2)
    assert found.rows is not None
    for k, own in enumerate(plans):
        alone = program(method, delayed=delayed).run(own, Start(z[:, [k]], p[:, [k]], BOUND))
        np.testing.assert_array_equal(found.rows[..., k], alone.rows[..., 0])
        np.testing.assert_array_equal(found.error[:, k], alone.error[:, 0])


def test_fewer_lanes_where_rows_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    made = plan(0)
    z, p = (np.column_stack(numbers) for numbers in zip(*(start_of(seed) for seed in range(5)), strict=True))
    members = MemberNumbers(z0=z, p=p, gain=made.gain, bias=made.bias, holds=made.holds, bound=BOUND)
    ensemble = Ensemble(system(False), "rk4", 8)
    wide = ensemble.run(made, members, rows=True)
    monkeypatch.setattr("hgorun.engine.ensemble._ROWS", 2 * STATES * made.grid.size)
    narrow = ensemble.run(made, members, rows=True)
    assert wide.rows is not None
    assert narrow.rows is not None
    np.testing.assert_array_equal(wide.rows, narrow.rows)
    assert set(ensemble._others) == {2, 8}


def test_numbers_that_a_plan_reads_have_to_be_there() -> None:
    z, p = start_of(0)
    made = plan(0)
    short = MemberNumbers(z0=z[:, None], p=p[:, None], gain=made.gain[:2], bias=made.bias, holds=made.holds)
    with pytest.raises(ValueError, match="gain has 2 rows, the plan needs 5"):
        Ensemble(system(False), "rk4", 2).run(made, short)


@pytest.mark.costly
def test_a_plant_that_diverges_ends_its_own_lane_alone() -> None:
    """The others have the bits that they have without it."""
    made = plan(1)
    z, p = (np.column_stack(numbers) for numbers in zip(*(start_of(seed) for seed in range(7)), strict=True))
    z[0, 2] = 1e301
    members = MemberNumbers(z0=z, p=p, gain=made.gain, bias=made.bias, holds=made.holds, bound=(1e300, 0.0))
    ensemble = Ensemble(system(False), "rk4", 4)
    for found in (ensemble.run(made, members, rows=True), ensemble.run_each([made] * 7, members, rows=True)):
        assert found.rows is not None
        assert list(np.isfinite(found.plant_diverged)) == [k == 2 for k in range(7)]
        for k in (0, 1, 3, 6):
            alone = program("rk4").run(made, Start(z[:, [k]], p[:, [k]], (1e300, 0.0)))
            np.testing.assert_array_equal(found.rows[..., k], alone.rows[..., 0])
        with pytest.raises(PlantDiverged) as alone_too:
            program("rk4").run(made, Start(z[:, [2]], p[:, [2]], (1e300, 0.0)))
        assert found.plant_diverged[2] == alone_too.value.at


def test_a_run_ends_when_nothing_is_left_of_what_is_awaited() -> None:
    """Alone and side by side, with one plan or each its own: up to there all is as in the whole run."""
    made, rising = plan(3, most_steps=200), [40.0, 30.0, 20.0]
    made = replace(made, actions=np.zeros((0, 5), dtype=np.int64), counts=made.counts * np.array([1, 1, 1, 1, 0, 0, 1]))
    z, p = (np.repeat(of[:, None], 3, axis=1) for of in start_of(3))
    p[1] = rising
    members = MemberNumbers(z0=z, p=p, gain=made.gain, bias=made.bias, holds=made.holds, bound=BOUND)
    awaited = replace(members, awaited=np.array([[0.0] * 3, [1.0] * 3]))
    ensemble = Ensemble(system(False), "rk4", 4)
    for plans in ([made], [made] * 3):
        whole, ended = (
            ensemble.run(made, of, rows=True) if len(plans) == 1 else ensemble.run_each(plans, of, rows=True)
            for of in (members, awaited)
        )
        assert whole.rows is not None
        assert ended.rows is not None
        last = whole.diverged[1].max()
        assert np.isfinite(last)
        assert np.array_equal(whole.diverged[1], ended.diverged[1])
        before = made.grid < last
        assert np.array_equal(whole.rows[before], ended.rows[before], equal_nan=True)
        assert np.array_equal(whole.rows[:, block(1)], ended.rows[:, block(1)], equal_nan=True)
        assert not np.array_equal(whole.rows[-1, :PLANT], ended.rows[-1, :PLANT])
    for k in range(3):
        start = Start(z[:, [k]], p[:, [k]], BOUND)
        one, short = program("rk4").run(made, start), program("rk4").run(made, start, until=[1])
        before = made.grid < one.diverged[1, 0]
        assert np.array_equal(one.rows[before], short.rows[before], equal_nan=True)
        assert np.array_equal(one.rows[:, block(1)], short.rows[:, block(1)], equal_nan=True)
        assert not np.array_equal(one.rows[-1, :PLANT], short.rows[-1, :PLANT])
        both = program("rk4").run(made, start, until=[0, 1])
        assert np.isfinite(both.diverged).all() or np.array_equal(both.rows, one.rows, equal_nan=True)
