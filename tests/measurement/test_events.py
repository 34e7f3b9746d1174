"""Kinks, jumps and poles of functions of time: none is missed, wherever it is and however short."""

from __future__ import annotations

import math
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hgorun
from hgorun.config.expressions import parse
from hgorun.measurement import extremes as measured_extremes
from hgorun.measurement.events import Irregular, Kinks, repeated
from hgorun.measurement.extremes import extremes
from hgorun.measurement.signals import delay_range
from hgorun.symbolic.crossings import TooMany

CLOCKS = st.sampled_from([0.0, -7.0, 1.7e9])
WIDTHS = st.floats(-9, 0).map(lambda e: 10.0**e)


def kinks(text: str, start: float, end: float, limit: float = np.inf, **numbers: float) -> Irregular:
    """Of an expression of t and of run-time numbers."""
    t, p = ca.SX.sym("t"), ca.SX.sym("p", len(numbers))
    symbols = {"t": t} | {name: p[i] for i, name in enumerate(numbers)}
    expression = parse(text, names=tuple(symbols)).symbol(symbols)
    return Kinks.of([expression], t, p).between(np.array(list(numbers.values())), start, end, limit)


def same(found: Irregular, expected: np.ndarray, start: float, end: float, units: int = 8) -> None:
    """All that is expected was found, and nothing else, to a few doubles; the ends do not count."""
    scale = units * np.spacing(max(abs(start), abs(end)))
    inside = [x[(x > start + scale) & (x < end - scale)] for x in (found.times, np.asarray(expected))]
    one = inside[0][np.concatenate([[True], np.diff(inside[0]) > scale])[: inside[0].size]]
    assert one.size == inside[1].size
    np.testing.assert_allclose(one, inside[1], rtol=0, atol=scale)
    assert found.lost == ()


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(CLOCKS, WIDTHS, st.floats(0.1, 0.9))
def test_a_pulse_of_any_width_is_found(clock: float, width: float, at: float) -> None:
    a = clock + 1000 * at
    b = a + max(width, 100 * np.spacing(a))
    found = kinks("where(t >= a and t < b, 1, 0)", clock, clock + 1000, a=a, b=b)
    np.testing.assert_array_equal(found.times, [a, b])


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(CLOCKS, st.floats(0.01, 3.0), st.floats(0.05, 0.95))
def test_pulses_that_repeat(clock: float, period: float, duty: float) -> None:
    end = clock + 200 * period
    found = kinks("t - n*floor((t - c)/n) - c < d*n", clock, end, n=period, c=clock, d=duty)
    k = np.arange(201)
    expected = np.unique(np.concatenate([clock + k * period, clock + (k + duty) * period]))
    same(found, expected, clock, end)


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(st.floats(0.5, 300.0), st.floats(-0.99, 0.99), st.floats(0, 6.28))
def test_a_sinusoid_above_a_level(omega: float, level: float, phase: float) -> None:
    found = kinks("sin(w*t + f) > c", 0, 20, w=omega, f=phase, c=level)
    turn, up = 2 * np.pi * np.arange(-2, 20 * omega / 6.28 + 3), math.asin(level)
    expected = np.sort(np.concatenate([up + turn - phase, np.pi - up + turn - phase])) / omega
    slope = math.sqrt(1 - level**2)
    same(found, expected, 0, 20, int(20 + 100 / slope))


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.1, 9.9), min_size=1, max_size=5, unique=True))
def test_a_polynomial_by_its_roots(roots: list[float]) -> None:
    text = "*".join(f"(t - r{i})" for i in range(len(roots)))
    found = kinks(f"abs({text})", 0, 10, **{f"r{i}": r for i, r in enumerate(roots)})
    # a root is the zero itself or the next double
    np.testing.assert_allclose(found.times, np.sort(roots), rtol=0, atol=4e-15)


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(st.floats(0.2, 4.0), st.floats(0.3, 9.7))
def test_all_steps_of_a_floor(omega: float, size: float) -> None:
    found = kinks("floor(a*sin(w*t))", 0, 10, a=size, w=omega)
    dense = np.linspace(0, 10, 20_001)
    values = np.floor(size * np.sin(omega * dense))
    changed = np.flatnonzero(np.diff(values))
    counts = np.searchsorted(found.times, dense)
    assert np.all(counts[changed + 1] > counts[changed])
    for k in range(math.ceil(-size), math.floor(size) + 1):
        for angle in (math.asin(k / size), np.pi - math.asin(k / size)):
            for time in (angle + 2 * np.pi * np.arange(-1, 8)) / omega:
                near = math.sqrt(1 - (k / size) ** 2) > 1e-6
                if 1e-9 < time < 10 and near:
                    assert np.min(np.abs(found.times - time)) < 1e-9


NESTED = [
    "abs(abs(sin(t)) - 0.4)",
    "t - floor(t) < 0.5 + 0.3*sin(t)",
    "max(min(sin(3*t), 0.5), cos(t)) + sign(cos(5*t) - 0.2)",
    "where(sin(t) > 0 and not (cos(2*t) > 0.3), floor(3*t), ceil(t**2/3))",
    "t**2 - floor(t**2) < 0.2 or abs(t - floor(t) - 0.5) < 0.1",
    "sin(exp(t/3)) > 0.5",
    "where(t - 2*floor(t/2) < 1, sin(7*t) > 0.9, cos(9*t) > 0.95)",
    "atan2(sin(3*t), cos(3*t)) > 1",
    "sin(sin(2.755*t)) < floor(sin(0.463*t))",  # the floor's argument touches 1 in the middle of a piece
    "sign(sqrt(abs(t*cos(2.021*t + 0.3))))",
]


@pytest.mark.slow
@pytest.mark.parametrize("text", NESTED)
def test_nothing_changes_between_kinks(text: str) -> None:
    """What floor, signs and comparisons give is constant between kinks; where it is constant there is no kink."""
    found = kinks(text, 0.0, 10.0)
    assert found.lost == ()
    assert found.infinite is None
    t = ca.SX.sym("t")
    value = ca.Function("f", [t], [parse(text, names=("t",)).symbol({"t": t})])
    grid = np.linspace(0, 10, 200_001)
    y = np.asarray(value(ca.DM(grid).T)).ravel()
    second = np.abs(np.diff(y, 2))
    # a kink or a jump makes the second difference far larger than the square of the spacing
    rough = np.flatnonzero(second > 3e-5) + 1
    distance = np.min(np.abs(grid[rough][:, None] - found.times[None, :]), axis=1, initial=np.inf)
    assert np.all(distance < 1.001e-4)


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("asin(sin(t))", [np.pi / 2, 3 * np.pi / 2, 5 * np.pi / 2]),
        ("sqrt((t - 3)**2)", [3.0]),
        ("sqrt(1 - cos(t))", [2 * np.pi]),
        ("atan(tan(t))", [np.pi / 2, 3 * np.pi / 2, 5 * np.pi / 2]),
    ],
)
def test_kinks_in_disguise(text: str, at: list[float]) -> None:
    found = kinks(text, 0.1, 9.0).times
    assert all(np.min(np.abs(found - expected)) < 1e-7 for expected in at)
    assert all(np.min(np.abs(np.array(at) - time)) < 1e-7 for time in found)


@pytest.mark.parametrize(
    "text", ["abs((t - 1)**2)", "max(t - 20, 0) > 0", "min(t, 20) < 20", "sin(t) > 1.0000001", "sin(2*pi*1e4*t) > 2"]
)
def test_no_kink_where_there_is_none(text: str) -> None:
    assert kinks(text, 0.0, 10.0).times.size == 0


@pytest.mark.parametrize(
    ("text", "when"),
    [
        ("1/(t - 0.503)", 0.503),
        ("1/(t - 0.503)**2", 0.503),
        ("1e-9/(t - 0.503)", 0.503),
        ("1/(1 - sin(t))", np.pi / 2),
        ("log(0.5 - t)", 0.5),
        ("sqrt(0.5 - t)", 0.5),
        ("tan(t)", np.pi / 2),
        ("(t - 0.7)**-1.5", 0.0),
        ("asin(t)", 1.0),
        ("exp(500*t)", 1.4),
    ],
)
def test_what_is_not_finite_is_told(text: str, when: float) -> None:
    found = kinks(text, 0.0, 2.0).infinite
    assert found is not None
    assert abs(found - when) < 0.7 if text.startswith("exp") else abs(found - when) < 1e-7


@pytest.mark.parametrize(
    "text",
    [
        "sin(t - 5)/(t - 5)",
        "where(t > 5, 1/(t - 4), 0)",
        "where(t > 5, sqrt(t - 5), 0)",
        "log(abs(t - 5))",
        "atan(1/(t - 5))",
        "1/(1 + t**2)",
        "1/(2 + sin(1e3*t))",
    ],
)
def test_what_is_finite_is_accepted(text: str) -> None:
    assert kinks(text, 0.0, 10.0).infinite is None


def test_a_function_that_cannot_be_followed_is_told() -> None:
    text = "sin(t)**2*cos(t/2)**2 - sin(t)**2*(1 + cos(t))/2 > 0"  # zero everywhere, but for rounding
    assert kinks(text, 0.0, 10.0).lost


def test_more_kinks_than_fit_are_refused_before_they_are_made() -> None:
    with pytest.raises(TooMany):
        kinks("floor(1e12*t)", 0.0, 1.0, limit=1e6)


@pytest.mark.costly
@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.0, 9.0), min_size=1, max_size=6), st.floats(0.01, 0.3))
def test_events_come_back_after_a_delay_that_changes(events: list[float], size: float) -> None:
    given_ = np.unique(events)
    found = repeated(given_, f"{size!r}*abs(sin(pi*t))", 0.0, 10.0).times
    then = found - size * np.abs(np.sin(np.pi * found))
    for event in given_[given_ > 1e-9]:
        # the slope of t - d(t) is at least 0.05, so it comes back exactly once
        assert np.count_nonzero(np.abs(then - event) < 1e-13) >= 1
    assert np.all(np.min(np.abs(then[:, None] - given_[None, :]), axis=1) < 1e-13)


# ------------------------------------------------------------------ runs, with default settings


def run(u: str, end: float, start: float = 0.0, rate: float = 0.0, **blocks: object) -> hgorun.Result:
    """x' = u - rate x from zero."""
    plant = {
        "states": ["x"],
        "dynamics": {"x": "u - a*x"},
        "output": "x",
        "parameters": {"a": rate},
        "inputs": {"u": u},
        "initial": {"x": 0},
    }
    time = {"start": start, "end": end, "output_step": (end - start) / 10}
    return hgorun.simulate(hgorun.Experiment({"time": time, "plant": plant, "observers": {}, **blocks}))


@pytest.mark.costly
@pytest.mark.parametrize(
    ("u", "start", "end", "integral"),
    [
        ("where(t > 500.0001 and t < 500.0021, 500, 0)", 0, 1000, 1.0),
        ("where(t < 5.0005, 1, 0)", 0, 10, 5.0005),
        ("1e4*t - floor(1e4*t) < 0.3", 0, 2, 0.6),
        ("sin(2*pi*1e4*t) > 0.3", 0, 2, 2 * (0.5 - math.asin(0.3) / math.pi)),
        ("t - 3600*floor(t/3600) < 10", 0, 30 * 86400, 7200.0),
        ("where(abs(t - 1.7e9 - 500) < 0.001, 500, 0)", 1.7e9, 1.7e9 + 1000, 1.0),
        ("max(0, sin(2*pi*t))", 0, 10, 10 / np.pi),
    ],
)
def test_an_integral_is_right(u: str, start: float, end: float, integral: float) -> None:
    clock = 500 * 4 * np.spacing(abs(start)) if start else 0.0
    assert run(u, end, start).x[-1, 0] == pytest.approx(integral, rel=1e-7, abs=clock)


def test_doses_every_hour() -> None:
    """Ten seconds of a pump every hour for thirty days, against the geometric series of the pulses."""
    k = 2e-5
    found = run("t - 3600*floor(t/3600) < 10", 30 * 86400, rate=k).x[-1, 0]
    one = (1 - math.exp(-10 * k)) / k * math.exp(-k * 3590)
    assert found == pytest.approx(one * (1 - math.exp(-k * 30 * 86400)) / (1 - math.exp(-k * 3600)), rel=1e-7)


@pytest.mark.parametrize(
    ("plant", "path"),
    [
        ({"inputs": {"u": "1/(t - 0.503)"}}, "plant.inputs.u"),
        ({"dynamics": {"x": "u - x/(t - 0.503)"}}, "plant.dynamics.x"),
        ({"disturbance": {"x": "log(0.503 - t)"}}, "plant.disturbance.x"),
        ({"output": "x*(1 + 1/(t - 0.503))"}, "plant"),
    ],
)
def test_a_pole_is_refused_where_it_stands(plant: dict[str, object], path: str) -> None:
    block = {"states": ["x"], "dynamics": {"x": "u"}, "output": "x", "inputs": {"u": "1"}, "initial": {"x": 0}}
    config = {"time": {"end": 1, "output_step": 0.1}, "plant": block | plant, "observers": {}}
    with pytest.raises(hgorun.ConfigError, match=r"not finite at t = 0\.503") as error:
        hgorun.simulate(hgorun.Experiment(config))
    assert path in str(error.value)


def test_noise_that_is_not_a_number_is_refused() -> None:
    noise = [{"type": "expression", "value": "log(0.5 - t)"}]
    with pytest.raises(hgorun.ConfigError, match=r"not finite at t = 0\.5"):
        run("1", 1.0, measurement={"noise": noise})


def test_a_microsecond_in_a_month() -> None:
    """Shorter than a billionth of a step."""
    assert run("where(t > 1e6 and t < 1e6 + 1e-6, 1e6, 0)", 30 * 86400).x[-1, 0] == pytest.approx(1.0, rel=2e-4)


@pytest.mark.parametrize(
    ("delay", "least", "most"),
    [
        ("0.1 + where(t > 5.0001 and t < 5.0021, 3, 0)", 0.1, 3.1),
        ("0.1 + 3*exp(-((t - 500)/1e-3)**2)", 0.1, 3.1),
        ("0.3*abs(sin(pi*t/2))", 0.0, 0.3),
    ],
)
def test_the_largest_delay_is_known(delay: str, least: float, most: float) -> None:
    plant = {"type": "integrator_chain", "initial": {"x1": 0, "x2": 0}}
    config = {"time": {"end": 1000, "output_step": 1}, "plant": plant, "observers": {}}
    stretch = hgorun.Experiment(config | {"measurement": {"delay": delay}}).stretches[0][0]
    assert delay_range(stretch) == pytest.approx((least, most), abs=1e-12)


def test_a_remark_tells_of_a_function_that_cannot_be_followed(tmp_path: Path) -> None:
    text = "sin(t)**2*cos(t/2)**2 - sin(t)**2*(1 + cos(t))/2 > 0"
    result = run(text, 10.0)
    (remark,) = result.remarks
    assert remark.startswith("plant.inputs.u: kinks or jumps between t = ")
    assert hgorun.read(result.save(tmp_path / "r.h5")).remarks == result.remarks
    assert run("1", 10.0).remarks == ()


def test_a_narrow_pulse_is_found_among_too_many_extremes(monkeypatch: pytest.MonkeyPatch) -> None:
    """sin(20 t) has 636 extremes in 100 s, of which none is looked for; the pulse at t = 33.3 is a hundred times as
    steep."""
    monkeypatch.setattr(measured_extremes, "EXTREMES", 100)
    t, p = ca.SX.sym("t"), ca.SX.sym("p", 1)
    calm, both = ca.sin(20 * t), ca.sin(20 * t) + p * ca.exp(-(((t - 33.3) / 1e-3) ** 2))
    found = extremes(Kinks.of_slopes([calm, both], t, p), np.array([2.0]), 0.0, 100.0)
    assert np.min(np.abs(found.times - 33.3)) < 1e-5
    assert found.times.size < 20
    assert found.lost == ((0.0, 100.0),)
    nothing = extremes(Kinks.of_slopes([calm], t, p), np.array([2.0]), 0.0, 100.0)
    assert not nothing.times.size
