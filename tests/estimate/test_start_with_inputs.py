"""Observers of the output's derivatives begin at their initial estimate, whatever the inputs are at the start."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import CONTOIS, Block, experiment, inline
from recordings import held_input, recording, signal, source
from shell import Shell

import hgorun
from hgorun.errors import ConfigError
from hgorun.estimate.carrying import estimates, one_pass
from hgorun.estimate.completed import completed
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.export.prepared import exported
from hgorun.simulation.simulate import prepare

DRIVEN = inline({"a": "b + u", "b": "c", "c": "-a"}, "a", inputs={"u": "0.5 + sin(2*t)"})
ASIDE = {"a": 0.2, "b": -0.4, "c": 0.7}
FAMILIES: dict[str, Block] = {
    "levant": {"G": 2},
    "red": {"L": 2},
    "savgol": {"window": 5},
    "cascade": {"theta": 3, "M": [5, 5]},
    "eso": {"omega_o": 3},
}


def derivatives(a: float, b: float, c: float, u: float, du: float) -> list[float]:
    """y = a, y' = b + u, y'' = c + u'."""
    return [a, b + u, c + du]


def of(family: str, plant: Block, initial: dict[str, float], **more: Any) -> hgorun.Experiment:
    keys = {"type": family, **FAMILIES[family], "initial": initial}
    sampled = {"sampling": {"period": 0.1, "offset": 0.1}} if family in ("savgol", "red") else {}
    solver = {"method": "euler", "step": 0.001} if family in ("levant", "red") else {"method": "rk4", "step": 0.01}
    return experiment(plant, {"O": keys}, **{"end": 0.2, "measurement": sampled, "solver": solver, **more})


@pytest.mark.measured("cascade")
@pytest.mark.costly
@pytest.mark.parametrize("family", FAMILIES)
def test_the_estimate_begins_at_the_initial_one(family: str) -> None:
    run = prepare(of(family, DRIVEN, ASIDE))
    (block,) = run.observers
    if family != "cascade":  # whose states are those of several differentiators
        z = run.numbers.z0[block.start : block.start + 3]
        np.testing.assert_allclose(z, derivatives(0.2, -0.4, 0.7, 0.5, 2.0), rtol=1e-14)
    found = hgorun.simulate(run.experiment)
    np.testing.assert_allclose(found.observers["O"].xhat[0], list(ASIDE.values()), rtol=1e-12)


def test_a_plant_that_has_no_state_for_inputs_of_zero() -> None:
    """y' = (mu s/(k_c x + s) - D) x of the Contois plant: without D nothing tells how much substrate there is."""
    run = prepare(of("levant", CONTOIS, {"x1": 1, "x2": 14}))
    (block,) = run.observers
    rate = 1.064 * 14 / (4.39 * 1 + 14)
    np.testing.assert_allclose(run.numbers.z0[block.start : block.start + 2], [1, rate - 1.064], rtol=1e-14)
    np.testing.assert_allclose(hgorun.simulate(run.experiment).observers["O"].xhat[0], [1, 14], rtol=1e-9)


def test_exported_code_begins_where_the_run_does() -> None:
    run = prepare(of("levant", DRIVEN, ASIDE))
    (one,) = exported(run)
    np.testing.assert_allclose(one.start[:3], derivatives(0.2, -0.4, 0.7, 0.5, 2.0), rtol=1e-14)


@pytest.mark.parametrize(("hold", "slope"), [("zero", 0.0), ("linear", -4.0)])
def test_recorded_inputs_begin_with_their_first_value(hold: str, slope: float) -> None:
    times = np.linspace(0, 1, 11)
    log = recording(signal("a", times, np.cos(times)), u=held_input("u", [0, 0.5], [3.0, 1.0], hold))
    config = {
        "plant": {key: value for key, value in DRIVEN.items() if key not in ("inputs", "initial")},
        "observers": {"O": {"type": "levant", **FAMILIES["levant"], "initial": ASIDE}},
        "solver": {"method": "euler", "step": 0.001},
    }
    prepared = prepare_estimate(completed(source(config), log, "x", ""), log)
    np.testing.assert_allclose(prepared.run.numbers.z0[:3], derivatives(0.2, -0.4, 0.7, 3.0, slope), rtol=1e-14)
    whole = estimates(prepared, times, one_pass(prepared, times, prepared.run.step)[0])[0]
    np.testing.assert_allclose(whole[0], list(ASIDE.values()), rtol=1e-12)


@pytest.mark.parametrize("together", [True, False])
def test_a_stream_begins_with_the_first_input_that_is_known(together: bool) -> None:
    estimator = Estimator(of("eso", DRIVEN, ASIDE), inputs=("u",))
    assert estimator.estimate()["O"][1] == pytest.approx(-0.4)  # with no input there is none to know of
    if together:
        estimator.update(0.0, {"a": 0.2}, u={"u": 3.0})
    else:
        estimator.update(0.0, {}, u={"u": 1.0})
        estimator.restore(estimator.checkpoint())
        estimator.update(0.0, {}, u={"u": 3.0})  # before anything follows from the one before
    np.testing.assert_allclose(estimator.estimate()["O"], list(ASIDE.values()), rtol=1e-12)
    estimator.update(0.1, {"a": 0.2}, u={"u": 5.0})
    assert abs(estimator.estimate()["O"][1] + 0.4) > 1  # y' is what it was, and u has become 5


def test_a_stream_has_the_bits_of_the_recording() -> None:
    times, changes = np.linspace(0.1, 1, 10), {0.0: 3.0, 0.45: 1.0, 0.75: 2.0, 1.0: 5.0}
    u = held_input("u", list(changes), list(changes.values()))
    log = recording(signal("a", times, np.cos(times)), u=u)
    config = {
        "time": {"start": 0.0, "end": 1.0, "output_step": 0.1},
        "plant": {key: value for key, value in DRIVEN.items() if key not in ("inputs", "initial")},
        "observers": {"O": {"type": "eso", **FAMILIES["eso"], "initial": ASIDE}},
        "solver": {"method": "rk4", "step": 0.01},
    }
    prepared = prepare_estimate(completed(source(config), log, "x", ""), log)
    whole = estimates(prepared, times, one_pass(prepared, times, prepared.run.step)[0])[0]
    estimator, found = Estimator(prepared.experiment, gates={}, inputs=("u",)), []
    for t in sorted({*changes, *times.tolist()}):
        if t in changes:
            estimator.update(t, {}, u={"u": changes[t]})
        if t in times:
            estimator.update(t, {"a": np.cos(t)})
            found.append(estimator.estimate()["O"].copy())
    assert np.array_equal(found, whole)


def test_a_stream_waits_for_inputs_that_it_cannot_begin_without() -> None:
    plant = inline({"a": "b", "b": "-a"}, {"y": "a/u + v"}, inputs={"u": "1", "v": "0"})
    estimator = Estimator(of("eso", plant, {"a": 0.2, "b": -0.4}), inputs=("u", "v"))
    estimator.update(0.0, {}, u={"v": 1.0})
    for t, y in ((0.0, {"y": 1.0}), (0.1, {})):
        with pytest.raises(ValueError, match="and u is not known yet: give inputs before the first sample"):
            estimator.update(t, y)
    with pytest.raises(ValueError, match="the derivatives of the output are not finite at the initial estimate"):
        estimator.update(0.0, {}, u={"u": 0.0})
    estimator.update(0.0, {"y": 1.1}, u={"u": 2.0})
    np.testing.assert_allclose(estimator.estimate()["O"], [0.2, -0.4], rtol=1e-9)


@pytest.mark.parametrize(("observer", "state"), [("eso", "initial"), ("shgo", "")])
def test_a_start_where_the_equations_have_no_numbers_is_told_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], observer: str, state: str
) -> None:
    gain = "omega_o: 4, b_0: 1" if observer == "eso" else "theta: 2"
    (tmp_path / "c.yaml").write_text(
        "plant:\n  states: [a, b]\n  dynamics: {a: b - sqrt(a) + u, b: -a}\n  output: {y: a}\n  inputs: {u: 0}\n"
        "data: {outputs: {y: y}, inputs: {u: u}}\nsolver: {step: 0.01}\n"
        f"observers:\n  O: {{type: {observer}, {gain}, initial: {{a: -0.1, b: 0}}}}\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0,u,1\n0,y,1\n0.1,y,1\n"))
    code = Shell(tmp_path, monkeypatch, capsys)("estimate", "c.yaml", "-")
    place = "c.yaml:9: observers.O" + (f".{state}" if state else "")
    assert code[0] == 2
    assert f"{place}: the " in code[2]
    assert "(with the inputs that have come by t = 0" in code[2]
    assert "standard input" not in code[2]


def test_an_estimate_without_derivatives_is_refused() -> None:
    """ln of the output's state has none at zero."""
    plant = inline({"a": "b + u", "b": "-a"}, "log(a)", inputs={"u": "t"})
    with pytest.raises(ConfigError, match="the derivatives of the output are not finite at the initial estimate"):
        prepare(of("levant", plant, {"b": 0.3}))
