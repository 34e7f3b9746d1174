"""Of a run of which some observers are known only the others are integrated, and its numbers are the same bits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from examples import CONTOIS, VAN_DER_POL, experiment, inline, sinusoid

from hgorun import Experiment, Result
from hgorun.errors import SimulationError
from hgorun.simulation import known as module
from hgorun.simulation.known import Known
from hgorun.simulation.passes.passes import integrate
from hgorun.simulation.simulate import prepare, simulate_prepared

START = {"initial": {"x1": 1, "x2": 10}}
HIGH = {"type": "shgo", "theta": 2, "poles": -1, **START}
FILTERED = {"type": "fhgo2", "r": 2, "theta": 2, "poles": -1, **START}
SAMPLED = {"sampling": {"period": 0.25}, "noise": sinusoid(0.1, 9.0)}


@pytest.fixture
def integrated(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The observers of every pass."""
    passes: list[list[str]] = []

    def counted(run: Any, how: Any) -> Any:
        passes.append([block.label for block in run.observers])
        return integrate(run, how)

    monkeypatch.setattr(module, "integrate", counted)
    return passes


def contois(observers: Mapping[str, Any]) -> Experiment:
    return experiment(CONTOIS, observers, end=10, step=0.01, measurement=SAMPLED)


def both(known: Known, one: Experiment) -> Result:
    """The result with what is known, which is that without."""
    run = prepare(one)
    found, plain = simulate_prepared(run, known=known), simulate_prepared(run)
    assert list(found.observers) == list(plain.observers)
    for label, observer in plain.observers.items():
        same = found.observers[label]
        assert same.verdict == observer.verdict
        pairs = [(same.xhat, observer.xhat)]
        pairs += [(same.internal[name], values) for name, values in observer.internal.items()]
        pairs += [(same.metrics[name], values) for name, values in observer.metrics.items()]
        assert all(np.array_equal(*pair, equal_nan=True) for pair in pairs)
    for name in ("x", "u", "y", "time"):
        assert np.array_equal(getattr(found, name), getattr(plain, name))
    assert np.array_equal(found.measurements.y, plain.measurements.y, equal_nan=True)
    assert found.integration is not None
    assert plain.integration is not None
    assert found.integration.evaluations == plain.integration.evaluations
    return found


@pytest.mark.costly
def test_only_what_differs_is_integrated(integrated: list[list[str]]) -> None:
    known, base = Known(), contois({"S": HIGH, "F": FILTERED, "G": FILTERED | {"theta": 3}})
    both(known, base)
    both(known, base.varied({"observers.F.theta": 1.5}))
    both(known, base.varied({"observers.F": None}))
    both(known, base.varied({"observers.F.r": 1, "observers.S": None}))
    both(known, base.varied({"observers.F.theta": 1.5, "observers.G": None}))
    both(known, base.varied({"observers.F.initial.x1": 2, "observers.S.theta": 1}))
    assert integrated == [["S", "F", "G"], ["F"], ["F"], ["S"], ["F"]]


@pytest.mark.costly
@pytest.mark.parametrize(
    "other",
    [
        {"measurement": SAMPLED | {"noise": sinusoid(0.2, 9.0)}},
        {"measurement": SAMPLED | {"noise": [{"type": "gaussian", "std": 0.1}]}},
        {"measurement": SAMPLED | {"sampling": {"period": 0.2}}},
        {"measurement": SAMPLED | {"delay": 0.05}},
        {"measurement": {"noise": sinusoid(0.1, 9.0)}},
        {"solver": {"method": "dopri5", "step": 0.01}},
        {"time": {"end": 10, "output_step": 0.05}},
    ],
)
def test_what_all_depend_on_is_part_of_what_is_known(other: dict[str, Any], integrated: list[list[str]]) -> None:
    known, one = Known(), contois({"S": HIGH, "F": FILTERED})
    both(known, one)
    both(known, one.varied(other))
    assert [sorted(labels) for labels in integrated] == [["F", "S"], ["F", "S"]]


@pytest.mark.costly
def test_an_observer_that_is_lost_is_known_as_lost(integrated: list[list[str]]) -> None:
    known, base = Known(), contois({"S": HIGH, "W": HIGH})
    both(known, base)
    wild = {"observers.W.theta": 40}  # too fast for what is sampled every 0.25 h
    lost, again = (both(known, base.varied(wild | more)) for more in ({}, {"observers.S.theta": 1}))
    assert lost.observers["W"].status == again.observers["W"].status == "diverged"
    assert integrated == [["S", "W"], ["W"], ["S"]]


@pytest.mark.costly
@pytest.mark.parametrize(
    ("solver", "delay", "late"),
    [({"rtol": 1e-6, "method": "dopri5"}, 0.0, {}), ({"step": 0.01}, 0.3, {"late": "replay"})],
    ids=["controlled", "replayed"],
)
def test_observers_that_share_steps_or_times_are_integrated_together(
    solver: dict[str, Any], delay: float, late: dict[str, Any], integrated: list[list[str]]
) -> None:
    observers, measurement = {"S": HIGH | late, "F": FILTERED}, SAMPLED | {"delay": delay}
    known, base = Known(), experiment(CONTOIS, observers, end=4, measurement=measurement, solver=solver)
    both(known, base)
    both(known, base.varied({"observers.F.theta": 1.5}))
    assert [sorted(labels) for labels in integrated] == [["F", "S"], ["F", "S"]]


def test_new_code_is_that_of_new_observers_alone() -> None:
    known, base = Known(), contois({"S": HIGH, "F": FILTERED | {"r": 3}})
    first, new = prepare(base), prepare(base.varied({"observers.F.r": 4}))
    assert known.compiled(first) == first.structure.compiled
    simulate_prepared(first, known=known)
    assert known.compiled(first)
    assert not known.compiled(new)
    simulate_prepared(new, known=known)
    assert known.compiled(new)
    assert not new.structure.compiled
    assert not Known().compiled(new)


def test_a_plant_that_diverges_is_told_whatever_is_known() -> None:
    known, escaping = Known(), inline({"x": "x**2"}, "x", start=1)
    base = experiment(escaping, {"S": {"type": "shgo", "theta": 2, "poles": -1}}, end=2, step=0.01)
    for theta in (2, 3):
        with pytest.raises(SimulationError, match="plant"):
            simulate_prepared(prepare(base.varied({"observers.S.theta": theta})), known=known)


def test_few_are_kept(integrated: list[list[str]]) -> None:
    known, base = Known(), experiment(VAN_DER_POL, {"S": HIGH}, end=1, step=0.01)
    for theta in (*range(1, 21), 20, 1):
        simulate_prepared(prepare(base.varied({"observers.S.theta": theta})), known=known)
    assert len(integrated) == 21
