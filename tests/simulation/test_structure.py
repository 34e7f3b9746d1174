"""A second run of one structure: no symbolic work, and the bits of a run of its own."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline, sinusoid

import hgorun
from hgorun import ConfigError, Experiment, Result
from hgorun.engine import program
from hgorun.measurement import events, sampling, signals
from hgorun.native.compiler import NativeModule
from hgorun.plants import build, expressions
from hgorun.simulation import plant_alone
from hgorun.simulation.design import forms
from hgorun.simulation.experiment import experiment as experiments
from hgorun.simulation.experiment import observed
from hgorun.simulation.outcome import outcome
from hgorun.simulation.preparation import first_step, preparation, scheduling
from hgorun.simulation.simulate import prepare
from hgorun.simulation.system import structure
from hgorun.simulation.timeline import grid, steps, tables
from hgorun.symbolic import crossings
from hgorun.symbolic.canonical import CanonicalForm

POLES: Block = {"theta": 2, "poles": -1}
SAMPLED: Block = {"sampling": {"period": 0.1}, "noise": sinusoid(0.1, 30.0)}
PENDULUM = inline(
    {"a": "b", "b": "-k*sin(a) + u"}, "a", parameters={"k": "1"}, inputs={"u": "0.3*sin(2*t)"}, disturbance={"b": "0.1"}
)
VAN_DER_POL_LIKE = inline({"a": "b + 0.1*b**3", "b": "-a"}, "a")
OBSERVED: dict[str, tuple[Block, Block, Block]] = {
    **{name: (PENDULUM, {"type": name, **POLES}, SAMPLED) for name in ("shgo", "fhgo2", "treangle", "low_power")},
    "integral": (PENDULUM, {"type": "integral", "r": 1, **POLES}, {"delay": 0.1, "noise": sinusoid(0.1, 30.0)}),
    "lowpass": (PENDULUM, {"type": "lowpass", "rho": 0.2, **POLES}, {"noise": sinusoid(0.1, 30.0)}),
    "shgo_riccati": (PENDULUM, {"type": "shgo_riccati", "theta": 2}, SAMPLED),
    "fhgo1": (PENDULUM, {"type": "fhgo1", "theta": 2, "delta": 4}, SAMPLED),
    "fhgo2_nuos": (PENDULUM, {"type": "fhgo2_nuos", "theta": 2}, SAMPLED),
    "direct": (PENDULUM, {"type": "direct", "theta": 2, "mu": 5, "phi": 10, "G": 1}, {}),
    "direct_dynamic": (
        PENDULUM,
        {"type": "direct_dynamic", "a": 1, "b": 2, "q": 0.2, "gamma": "0.1", "mu_0": 5, "phi": 10, "G": 1},
        {},
    ),
    "dynamic_gain": (PENDULUM, {"type": "dynamic_gain", "a": 1, "b": 2, "q": 0.2, "gamma": "0.1"}, {}),
    "levant": (VAN_DER_POL_LIKE, {"type": "levant", "G": 2}, {}),
    "hgo_fd": (chain(2, "-x1"), {"type": "hgo_fd", "eps": 0.3}, {"sampling": {"period": 0.1}}),
    "reduced_sampled": (PENDULUM, {"type": "reduced_sampled", "H": 3}, {"sampling": {"period": 0.1}}),
    "deadbeat": (PENDULUM, {"type": "deadbeat"}, {"sampling": {"period": 0.1}}),
}
CHANGES: dict[str, dict[str, Any]] = {
    "theta": {"observers.o.theta": 2.5},
    "gains": {"observers.o.G": 3, "observers.o.H": 2, "observers.o.eps": 0.25, "observers.o.a": 1.1},
    "plant": {"plant.parameters.k": "1.2", "plant.initial.a": 0.6},
    "initial": {"observers.o.initial": {"a": 0.1}},
    "input": {"plant.inputs.u": "0.4*sin(3*t)", "plant.disturbance.b": "0.2"},
    "seed": {"seed": 3},
}


def forget() -> None:
    """Everything that one run may have left for another."""
    for memo in (
        structure._STRUCTURES, preparation._CHANNELS, scheduling._SCHEDULES, first_step._SLOPES, preparation._TRUTHS,
        forms._FOUND, forms._DECIDED, tables._TABLES, outcome._INPUTS, plant_alone._KINKS, plant_alone._PROGRAMS,
        build._BUILT, signals._COMPILED, events._PLACES, events._FOUND, sampling._FOUND, observed._STRETCHES,
        experiments._DESIGNS, grid._GRIDS, grid._POINTS, steps._STEPS,
    ):  # fmt: skip
        memo.clear()
    for function in (expressions.inputs_of, expressions.disturbance_of, expressions._values):
        function.cache_clear()


def assert_equal(a: Result, b: Result) -> None:
    for name in ("time", "x", "u", "y"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    for name in ("time", "taken", "y"):
        assert np.array_equal(getattr(a.measurements, name), getattr(b.measurements, name), equal_nan=True)
    assert list(a.observers) == list(b.observers)
    for label, observer in a.observers.items():
        other = b.observers[label]
        assert np.array_equal(observer.xhat, other.xhat, equal_nan=True)
        assert observer.gains == other.gains
        assert observer.internal.keys() == other.internal.keys()
        for name, values in observer.internal.items():
            assert np.array_equal(values, other.internal[name], equal_nan=True)
        for name, metric in observer.metrics.items():
            assert np.array_equal(metric, other.metrics[name], equal_nan=True)


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, int]]:
    """How often symbols, functions, expressions and code are made or hashed, and kinks are looked for."""
    counts: dict[str, int] = {}

    def count(owner: Any, name: str, *, of_class: bool = False) -> None:
        original = getattr(owner, name)

        def counting(*args: Any, **kwargs: Any) -> Any:
            counts[name] = counts.get(name, 0) + 1
            return original(*args, **kwargs)

        patch.setattr(owner, name, staticmethod(counting) if of_class else counting)

    with monkeypatch.context() as patch:
        count(ca.SX, "sym", of_class=True)
        count(ca.Function, "map")
        for name in ("Function", "substitute", "jacobian", "jtimes", "vertcat", "vertsplit", "cse", "which_depends"):
            count(ca, name)
        count(program, "generate")
        count(NativeModule, "__init__")
        count(hashlib, "sha256")
        count(crossings.Search, "between")
        yield counts


@pytest.mark.one_in(3)
@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("name", OBSERVED)
@pytest.mark.parametrize("change", CHANGES)
def test_a_run_through_the_cache_has_the_bits_of_a_fresh_one(name: str, change: str) -> None:
    plant, block, measurement = OBSERVED[name]
    method = {"solver": {"method": "euler", "step": 0.002}} if name in ("levant", "direct", "direct_dynamic") else {}
    base = experiment(plant, {"o": block}, end=1.0, output_step=0.05, step=0.01, measurement=measurement, **method)
    keys = {path: value for path, value in CHANGES[change].items() if _there(base, path)}
    varied = base.varied(keys)
    fresh = Experiment(varied.source.data, name="test")
    hgorun.simulate(base)
    second = hgorun.simulate(varied)
    forget()
    assert_equal(second, hgorun.simulate(fresh))


def _there(base: Experiment, path: str) -> bool:
    """Whether a change is one of an experiment: of a key that it has, or of an initial estimate."""
    value = base.source.data
    if path == "seed" or (path.endswith("o.initial") and "a" in base.plant.model.states):
        return True
    for key in path.split("."):
        if not isinstance(value, dict) or key not in value:
            return False
        value = value[key]
    return True


SECOND: dict[str, dict[str, Any]] = {
    "theta": {"observers.SHGO.theta": 3},
    "poles": {"observers.FHGO.poles": [-1, -2, -3]},
    "saturation": {"observers.SHGO.saturation.x1": [0, 9]},
    "initial estimate": {"observers.SHGO.initial.x2": 11},
    "initial state": {"plant.initial.x1": 1.4},
    "parameter": {"plant.parameters.mu": 1.1},
    "input": {"plant.inputs.D": "mu*(0.9 - abs(sin(t))/3)"},
    "disturbance": {"plant.disturbance.x1": "0.02*max(0, cos(t))"},
    "noise": {"measurement.noise.0.terms.0.amplitude": 0.2},
    "seed": {"seed": 5},
    "everything": {"observers.SHGO.theta": 2, "plant.initial.x2": 14, "plant.parameters.k_c": 4.5, "seed": 1},
}
REACHED: dict[str, Block] = {
    "sampled": {"sampling": {"period": 0.25}, "noise": [*sinusoid(0.1, 12.0), {"type": "gaussian", "std": 0.1}]},
    "at random": {"sampling": {"period": 0.25, "jitter": 0.1, "dropout": 0.2}, "noise": sinusoid(0.1, 12.0)},
    "late": {"delay": 0.1, "noise": [*sinusoid(0.1, 12.0), {"type": "gaussian", "std": 0.1, "hold": 0.05}]},
}
ONLY_SEEDS = {"sha256"}  # of the name of a channel, whose random numbers are its own


@pytest.mark.slow
@pytest.mark.parametrize("change", SECOND)
@pytest.mark.parametrize("reached", REACHED)
def test_a_second_run_costs_no_symbolic_work(reached: str, change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    observers = {
        "SHGO": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}, "saturation": {"x1": [0, 10]}},
        "FHGO": {"type": "fhgo2", "r": 1, "theta": 2, "initial": {"x1": 1, "x2": 14}},
        "K": {"type": "shgo_riccati", "theta": 2, "initial": {"x1": 1, "x2": 14}},
    }
    plant = {**CONTOIS, "disturbance": {"x1": "0.01*max(0, cos(t))"}}
    base = experiment(plant, observers, end=5.0, output_step=0.05, step=0.01, measurement=REACHED[reached])
    first = prepare(base)
    hgorun.simulate(base)
    with counted(monkeypatch) as counts:
        varied = base.varied(SECOND[change])
        run = prepare(varied)
        hgorun.simulate(varied)
    assert run.structure is first.structure
    assert not counts.keys() - ONLY_SEEDS
    assert "sha256" not in counts or change in ("seed", "noise", "everything")


@pytest.mark.costly
def test_a_start_of_newtons_method_is_a_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """x is found from y, y' by Newton's method, which starts at the plant's initial state."""
    observer = {"o": {"type": "levant", "G": 2, "initial": {"a": 0.1}}}
    solver = {"method": "euler", "step": 0.01}
    base = experiment(VAN_DER_POL_LIKE, observer, end=0.5, output_step=0.05, measurement={}, solver=solver)
    hgorun.simulate(base)
    varied = base.varied({"plant.initial.a": 0.6, "plant.initial.b": -0.4})
    with counted(monkeypatch) as counts:
        second = hgorun.simulate(varied)
    assert not counts
    forget()
    assert_equal(second, hgorun.simulate(Experiment(varied.source.data, name="test")))


def test_a_plant_without_chains_keeps_its_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The input multiplies b in a', so that it can hide b."""
    plant = inline({"a": "u*b", "b": "-k*b"}, "a", inputs={"u": "cos(t)"}, parameters={"k": "1"})
    block = {"type": "impulsive_riccati", "theta": 2, "initial": {"a": 0.1}}
    sampled = {"sampling": {"period": 0.1}}
    base = experiment(plant, {"o": block}, end=1.0, output_step=0.1, step=0.02, measurement=sampled)
    structure = prepare(base).structure
    hgorun.simulate(base)
    varied = base.varied({"plant.parameters.k": "1.2", "plant.initial.b": 0.3})
    with counted(monkeypatch) as counts:
        second = hgorun.simulate(varied)
    assert "generate" not in counts
    assert prepare(varied).structure is structure
    forget()
    assert_equal(second, hgorun.simulate(Experiment(varied.source.data, name="test")))


@pytest.mark.costly
def test_what_the_equations_read_decides_the_structure() -> None:
    base = experiment(CONTOIS, {"o": {"type": "fhgo2", "r": 1, "theta": 2, "initial": {"x1": 1, "x2": 14}}}, step=0.01)
    known = prepare(base).structure
    assert prepare(base.varied({"observers.o.theta": 3})).structure is known
    assert prepare(base.varied({"observers.o.r": 2})).structure is not known
    assert prepare(base.varied({"observers.o.saturation": {"x1": [0, 9]}})).structure is not known
    assert prepare(base.varied({"measurement": {"sampling": {"period": 0.1}}})).structure is not known
    assert prepare(base.varied({"plant.inputs.D": "mu*cos(t)**2"})).structure is not known


@pytest.mark.costly
def test_a_rank_that_is_lost_is_refused_as_in_a_fresh_run() -> None:
    """y = a, a' = k b: for k = 0 the output does not show b."""
    plant = inline({"a": "k*b", "b": "-a"}, "a", parameters={"k": "2"})
    base = experiment(plant, {"o": {"type": "shgo", "theta": 2, "initial": {"b": 1}}}, step=0.01)
    hgorun.simulate(base)
    changed = base.varied({"plant.parameters.k": "0"})
    with pytest.raises(ConfigError) as cached:
        hgorun.simulate(changed)
    forget()
    with pytest.raises(ConfigError) as fresh:
        hgorun.simulate(Experiment(changed.source.data, name="test"))
    assert cached.value.message == fresh.value.message
    assert "cannot be told apart" in cached.value.message


def test_another_choice_of_chains_is_another_structure() -> None:
    """Two outputs share three states 2 + 1 or 1 + 2, whichever is regular."""
    rates = {"a": "k*c", "b": "m*c", "c": "-a - b"}
    plant = inline(rates, ["2*a", "3*b"], parameters={"k": "1", "m": "0"})
    base = experiment(plant, {"o": {"type": "shgo", "theta": 2, "initial": {"c": 0.5}}}, step=0.01)
    first = prepare(base)
    other = base.varied({"plant.parameters.k": "0", "plant.parameters.m": "2"})
    second = prepare(other)
    chains = [form.chains for run in (first, second) if isinstance(form := run.forms["o"], CanonicalForm)]
    assert len(chains) == 2
    assert chains[0] != chains[1]
    assert second.structure is not first.structure
    assert prepare(base).structure is first.structure
    cached = hgorun.simulate(other)
    forget()
    assert_equal(cached, hgorun.simulate(Experiment(other.source.data, name="test")))


def test_signal_to_noise_ratio_is_a_step_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    measurement = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "snr_db": 20}]}
    base = experiment(
        CONTOIS, {"o": {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": 14}}}, step=0.01, measurement=measurement
    )
    hgorun.simulate(base)
    with counted(monkeypatch) as counts:
        hgorun.simulate(base.varied({"plant.initial.x1": 2}))
    assert not counts.keys() - ONLY_SEEDS
