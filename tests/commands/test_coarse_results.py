"""What is said of numbers that a given step or given tolerances make wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment
from shell import Shell

import hgorun
from hgorun.commands.remarks import coarse, coarse_members
from hgorun.ensemble.blocks import checked
from hgorun.ensemble.collected.outcome import largest_of_ok
from hgorun.result.records.data import IntegrationError
from hgorun.result.result import Result


def _result(measurement: dict[str, object] | None = None, **solver: object) -> Result:
    observers, time = {"S": {"type": "shgo", "theta": 2}}, {"end": 4, "output_step": 0.1}
    return hgorun.simulate(experiment(VAN_DER_POL, observers, solver=solver, time=time, measurement=measurement or {}))


def _with_error(result: Result, error: float) -> Result:
    assert result.integration is not None
    return replace(result, integration=replace(result.integration, error=IntegrationError({"S": error})))


@pytest.fixture(scope="module")
def rough() -> Result:
    result = _result(method="euler", step=0.02)
    assert result.integration_error is not None
    return result


def test_a_step_that_is_too_long_is_told_with_a_better_one(rough: Result) -> None:
    (told,) = coarse(_with_error(rough, 0.05))
    assert told.startswith("observer S: the integration error is about 0.05; give a step of 0.0004")  # 1/50 of it


def test_it_is_shorter_than_steps_that_end_at_samples() -> None:
    """Steps of 4 of which none is made, since samples are 0.19 apart: half of that, rounded down."""
    told = list(coarse(_with_error(_result({"sampling": {"period": 0.19}}, step=4), 0.012)))
    assert told == ["observer S: the integration error is about 0.01; give a step of 0.09, or leave it out"]


def test_numbers_that_are_wrong_altogether_are_told(rough: Result) -> None:
    (told,) = coarse(_with_error(rough, 3.0))
    assert "is as large as the numbers; give a step of 0.0002" in told  # no more than a hundred times shorter


def test_small_errors_and_unknown_methods_are_passed_over(rough: Result) -> None:
    assert not list(coarse(_with_error(rough, 1e-3)))
    assert not list(coarse(replace(rough, integration=None)))


def test_of_tolerances_smaller_ones_are_advised() -> None:
    result = _result(method="dopri5", rtol=1e-3)
    (told,) = coarse(_with_error(result, 0.05))
    assert "give smaller tolerances than rtol 0.001, or leave it out" in told


ROUGH = """
time: {end: 4, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers:
  S: {type: shgo, theta: 2}
solver: {method: euler, step: 0.1}
runs: {rough: {seeds: 2}}
"""


def test_every_command_tells_it_of_ensembles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    (tmp_path / "base.yaml").write_text(ROUGH.partition("runs")[0])
    (tmp_path / "study.yaml").write_text(ROUGH)
    (tmp_path / "rough.yaml").write_text("{base: base.yaml, axes: {seed: {count: 2}}}")
    monkeypatch.setattr(checked, "chosen", lambda size, seed: [1])
    errors = hgorun.simulate("base.yaml").integration_error
    assert errors is not None
    assert min(errors.values()) > 0.01
    said = [
        f"hgorun: rough: {who}: the integration error is about {errors[name]:.1g} in the worst member checked; give a "
        "shorter step or smaller tolerances, or leave them out"
        for name, who in (("plant", "plant"), ("S", "observer S"))
    ]
    for words in ("simulate study.yaml", "sweep rough.yaml", "compare results/rough.sweep.h5 --no-plots"):
        code, _, err = shell(*words.split())
        assert (code, err.splitlines()) == (0, said)


def test_of_members_that_are_not_ok_it_is_said_already() -> None:
    errors = np.array([[0.2, 3.0, 0.3], [0.1, 0.02, 0.1], [np.nan] * 3])
    status = np.array([[2, 2], [0, 1], [0, 0]], dtype=np.int8)
    largest = largest_of_ok(["a", "b"], errors, status)
    assert largest == {"plant": 0.1, "a": 0.02}
    assert [one.partition(": ")[0] for one in coarse_members(largest)] == ["plant", "observer a"]
    assert not list(coarse_members({"a": 0.01}))
    assert not largest_of_ok(["a"], np.empty((0, 0)), status[:, :1])
