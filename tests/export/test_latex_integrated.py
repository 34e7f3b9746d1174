"""Equations in LaTeX, read back and integrated by themselves, follow the run that they were exported from."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from examples import Block, experiment, inline
from printed_equations import Printed, Time, Vector, newest

import hgorun
from hgorun.export.latex import latex
from hgorun.export.observer import Exported
from hgorun.export.prepared import Wanted, exported
from hgorun.observers.base import OBSERVERS
from hgorun.simulation.preparation.preparation import prepare
from hgorun.tables.typeset import symbol
from hgorun.testing.cases import Subject

TAU = r"\tau"
NOT_EXPORTED = ("aekf", "bank", "kkl", "mhe", "predictor_chain", "switched")
ONE = [name for name in sorted(OBSERVERS.names()) if name not in (*NOT_EXPORTED, "luenberger_exact")]
# Those that take two outputs, each with samples at times of its own.
TWO = (
    *("adaptive", "dead_zone", "ekf", "extended", "fhgo1", "fhgo2", "hg_ekf", "homogeneous", "impulsive", "integral"),
    *("impulsive_riccati", "kalman_bucy", "lowpass", "luenberger_exact", "piecewise", "prescribed_time", "shgo"),
    *("shgo_riccati", "stubborn", "super_twisting", "treangle", "ukf", "updated"),
)
STEP = 0.01
END = 1.0

Known = dict[str, Callable[[float], float]]
Times = dict[str, Time]


def x1(t: float) -> float:
    return math.cos(t) + 0.5 * math.sin(t)


def x2(t: float) -> float:
    return 0.5 * math.cos(t) - math.sin(t)


def oscillator(output: object, inputs: Mapping[str, str] | None = None) -> Block:
    """x1 and x2 in closed form."""
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", inputs=inputs or {})
    return plant | {"initial": {"x1": 1, "x2": 0.5}, "output": output}


def every(period: float, late: float = 0.0, start: float = 0.0) -> Time:
    """Samples with a period, from a time on, late or not."""
    arrived = [start + k * period for k in range(round((END - start) / period) + 1)]
    return newest(arrived, [t - late for t in arrived])


def until(end: float, first: Time, then: Time) -> Time:
    """One after the other."""
    return lambda now, begun: first(now, begun) if begun < end - 1e-9 else then(now, begun)


def wrapped(value: Callable[[float], float], period: float) -> Callable[[float], float]:
    """As an encoder tells it."""
    return lambda t: value(t) - period * math.floor(value(t) / period + 0.5)


@dataclass
class Case:
    """A run, and what a reader of its equations knows beside them."""

    plant: Block
    measurement: Block
    known: Known
    times: Times = field(default_factory=dict)
    observer: Block = field(default_factory=lambda: {"type": "shgo", "theta": 3})
    start: float = 0.0


SAMPLED: Block = {"sampling": {"period": 0.1}}
TURNING = inline({"a": "b", "b": "0"}, "a", initial={"a": 2.5, "b": 9}) | {
    "output": {"phi": {"value": "a", "period": "2*pi"}}
}
PHI: Known = {r"\phi": wrapped(lambda t: 2.5 + 9 * t, 2 * math.pi)}
CASES = {
    "an angle, sampled": Case(TURNING, SAMPLED, PHI, {TAU: every(0.1)}),
    "an angle": Case(TURNING, {}, PHI),
    "an angle that is late": Case(TURNING, {"delay": 0.13}, {r"\phi": lambda t: PHI[r"\phi"](max(t, 0.0))}),
    "two rates": Case(
        oscillator(["x1", "x2"]),
        SAMPLED | {"outputs": {"x2": {"sampling": {"period": 0.25}}}},
        {"x_{1}": x1, "x_{2}": x2},
        {r"\tau_{1}": every(0.1), r"\tau_{2}": every(0.25)},
    ),
    "one sampled, one late": Case(
        oscillator(["x1", "x2"]),
        {"outputs": {"x1": {"delay": "0.1 + 0.05*sin(3*t)"}, "x2": {"sampling": {"period": 0.25}}}},
        {"x_{1}": x1, "x_{2}": x2},
        {r"\tau_{2}": every(0.25)},
    ),
    "one sampled, one continuous": Case(
        oscillator(["x1", "x2"]),
        {"outputs": {"x2": SAMPLED}},
        {"x_{1}": x1, "x_{2}": x2},
        {r"\tau_{2}": every(0.1)},
    ),
    "late samples": Case(oscillator("x1"), SAMPLED | {"delay": 0.25}, {"x_{1}": x1}, {TAU: every(0.1, 0.25)}),
    "a delay": Case(oscillator("x1"), {"delay": "1/8"}, {"x_{1}": x1}),
    "a delay by the clock": Case(oscillator("x1"), {"delay": "0.1 + 0.05*sin(3*t)"}, {"x_{1}": x1}, start=2.0),
    "a product": Case(
        oscillator({"y": "exp(x1/4)*x1"}),
        SAMPLED,
        {"y": lambda t: math.exp(x1(t) / 4) * x1(t)},
        {TAU: every(0.1)},
    ),
    "an abbreviation": Case(
        oscillator({"y": "exp(x1/4 + x2/8)"}),
        SAMPLED,
        {"y": lambda t: math.exp(x1(t) / 4 + x2(t) / 8)},
        {TAU: every(0.1)},
    ),
    "a product with an input": Case(
        oscillator({"y": "x1*(2 + u)"}, inputs={"u": "sin(5*t)"}),
        SAMPLED,
        {"y": lambda t: x1(t) * (2 + math.sin(5 * t)), "u": lambda t: math.sin(5 * t)},
        {TAU: every(0.1)},
    ),
    "a function": Case(
        oscillator({"y": "sinh(x1)"}),
        {"delay": 0.12},
        {"y": lambda t: math.sinh(x1(t))},
    ),
    "phases": Case(
        oscillator("x1"),
        {"phases": [{"until": 0.5}, {"until": END, "sampling": {"period": 0.2, "offset": 0.1}}]},
        {"x_{1}": x1},
        {TAU: until(0.5, lambda now, begun: now, every(0.2, start=0.6))},
    ),
    "phases with a delay": Case(
        oscillator(["x1", "x2"]),
        {"phases": [{"until": 0.5, **SAMPLED}, {"until": END, "delay": "0.12"}]},
        {"x_{1}": x1, "x_{2}": x2},
        {rf"\tau_{{{i}}}": until(0.5, every(0.1), lambda now, begun: now - 0.12) for i in (1, 2)},
    ),
    "letters of the plant": Case(
        inline({"alpha": "tau", "r": "-alpha"}, "alpha", initial={"alpha": 1, "r": 0.5}, inputs={"tau": "cos(t)"})
        | {"output": ["alpha", "r"]},
        SAMPLED,
        {
            r"\alpha": lambda t: 1 + math.sin(t),
            "r": lambda t: 0.5 - t - 1 + math.cos(t),
            r"\tau": math.cos,
        },
        {r"\bar{\tau}_{1}": every(0.1), r"\bar{\tau}_{2}": every(0.1)},
    ),
    "other coordinates": Case(
        oscillator({"y": "2*x1"}),
        SAMPLED,
        {"y": lambda t: 2 * x1(t)},
        {TAU: every(0.1)},
        {"type": "shgo", "theta": 3, "coordinates": "canonical"},
    ),
    "clipped": Case(
        oscillator("x1"),
        SAMPLED,
        {"x_{1}": x1},
        {TAU: every(0.1)},
        {"type": "shgo", "theta": 3, "saturation": {"x2": [-0.3, 0.3]}, "clip_estimate": True},
    ),
    "letters of the observer": Case(
        oscillator("x1"), SAMPLED, {"x_{1}": x1}, {TAU: every(0.1)}, {"type": "treangle", "theta": 2}
    ),
}


def estimated(printed: Printed, observer: Exported) -> Vector:
    """The printed estimate at the output points."""
    printed.integrate(END, STEP)
    return printed.estimates([symbol(state, hat=True) for state in observer.states])[:, :: round(0.05 / STEP)]


def followed(case: Case) -> None:
    aside = {state: value + 0.2 for state, value in case.plant["initial"].items()}
    observers = {"O": case.observer | {"initial": aside}}
    time = {"start": case.start, "end": case.start + END, "output_step": 0.05}
    run = experiment(case.plant, observers, measurement=case.measurement, step=STEP, time=time)
    observer = exported(prepare(run), Wanted(steps=False))[0]
    printed = Printed(latex(observer), case.known, case.times)
    found = estimated(printed, observer)
    expected = hgorun.simulate(run).observers["O"].xhat.T
    size = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * size)


@pytest.mark.costly
@pytest.mark.parametrize("name", CASES)
def test_the_printed_equations_follow_the_run(name: str) -> None:
    followed(CASES[name])


def of_family(name: str, plant: Block, measurement: Block, known: Known, arrivals: Sequence[Sequence[float]]) -> None:
    """An observer of a family follows its equations, with an estimate that begins aside."""
    keys = Subject(OBSERVERS.find(name), name, {}, None).cases[0].keys
    aside = {state: value + 0.4 for state, value in plant["initial"].items()}
    observers = {name: {"type": name, **keys, "initial": aside}}
    run = experiment(plant, observers, measurement=measurement, step=STEP, output_step=0.05)
    observer = exported(prepare(run), Wanted(steps=False))[0]
    taus = [TAU] if len(arrivals) == 1 else [rf"\tau_{{{i + 1}}}" for i in range(len(arrivals))]
    times = {tau: newest(taken, taken) for tau, taken in zip(taus, arrivals, strict=True)}
    printed = Printed(latex(observer), known, times if observer.compares else {}, () if observer.compares else arrivals)
    found = estimated(printed, observer)
    expected = hgorun.simulate(run).observers[name].xhat.T
    between = [k for k in range(expected.shape[1]) if all(abs(0.05 * k - t) > 0.01 for of in arrivals for t in of)]
    assert len(between) > 8
    np.testing.assert_allclose(found[:, between], expected[:, between], rtol=0, atol=1e-4 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ONE)
def test_every_family_counts_in_periods(name: str) -> None:
    """Whole periods are left out, by the flow and by jumps."""
    plant = oscillator({"q": {"value": "x1", "period": 0.6}})
    arrivals = [[0.1 * k for k in range(1, 11)]]
    measurement = {"sampling": {"period": 0.1, "offset": 0.1}}
    of_family(name, plant, measurement, {"q": wrapped(x1, 0.6)}, arrivals)


@pytest.mark.slow
@pytest.mark.parametrize("name", TWO)
def test_every_family_knows_the_samples_of_each_output(name: str) -> None:
    plant = inline({"x1": "x2", "x2": "-x1", "x3": "x4", "x4": "-x3"}, ["x1", "x3"])
    plant |= {"initial": {"x1": 1, "x2": 0.5, "x3": 0.5, "x4": -1}}
    arrivals = [[0.1 * k for k in range(11)], [0.3 * k for k in range(4)]]
    measurement = {**SAMPLED, "outputs": {"x3": {"sampling": {"period": 0.3}}}}
    of_family(name, plant, measurement, {"x_{1}": x1, "x_{3}": x2}, arrivals)
