"""``Experiment.varied``: the same but for some values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from examples import CONTOIS, experiment, load

from hgorun import ConfigError, Experiment

TEXT = """\
time: {end: 1, output_step: 0.1}
plant:
  type: contois
  parameters: {mu: 1.064, k_c: 4.39, s_in: 20}
  inputs: {D: mu*(1 - abs(sin(t))/2)}
  initial: {x1: 1.5, x2: 15}
observers:
  F r=1:
    type: fhgo2
    theta: 2
    initial: {x1: 1, x2: 14}
  S: {type: shgo, theta: 1, initial: {x1: 1, x2: 14}}
measurement:
  noise:
    - type: sinusoids
      terms: [{amplitude: 1, omega: 3}]
solver: {step: 0.01}
"""


@pytest.fixture
def base(tmp_path: Path) -> Experiment:
    return load(tmp_path, TEXT)


@pytest.mark.parametrize(
    "changes",
    [
        {"observers.F r=1.theta": 3},
        {"observers.F r=1.r": 2, "observers.S.theta": 4},
        {"observers.S": None},
        {"observers.T": {"type": "shgo_riccati", "theta": 3}},
        {"observers": {"O": {"type": "shgo", "theta": 5}}},
        {"measurement.noise.0.terms.0.amplitude": 0.3},
        {"measurement": {}},
        {"measurement": None},
        {"measurement.sampling.period": 0.1},
        {"plant.initial.x1": 2, "plant.parameters.mu": "1.1"},
        {"time.end": 2, "solver.method": "euler"},
        {"metrics.window": [0, 1]},
        {"seed": 4},
        {"title": "another"},
        {"solver": None},
        {},
    ],
)
def test_it_is_the_experiment_of_the_changed_configuration(base: Experiment, changes: dict[str, Any]) -> None:
    before = base.resolved()
    varied = base.varied(changes)
    fresh = Experiment(varied.source.data, name=base.name)
    assert varied.resolved() == fresh.resolved()
    assert varied.blocks == fresh.blocks
    assert list(varied.observers) == list(fresh.observers)
    assert base.resolved() == before
    for path, value in changes.items():
        if value is not None and path.startswith("observers.F"):
            assert getattr(varied.observers["F r=1"], path.rpartition(".")[2]) == value


def test_what_has_not_changed_is_shared(base: Experiment) -> None:
    plant, stretches, grid = base.plant, base.stretches, base.grid
    varied = base.varied({"observers.S.theta": 3}, name="other")
    assert (varied.name, base.name) == ("other", "experiment")
    assert varied.plant is plant
    assert varied.stretches is stretches
    assert varied.grid is grid
    assert varied.observers["F r=1"] is base.observers["F r=1"]
    assert varied.designs["F r=1"] is not varied.designs["S"]
    assert base.varied({"plant.initial.x1": 3}).plant.symbolic is plant.symbolic
    assert base.varied({"time.end": 2}).grid[0].size > grid[0].size
    assert base.varied({}, seed=9).blocks.seed == 9


@pytest.mark.parametrize(
    ("changes", "line", "key"),
    [
        ({"observers.F r=1.theta": -1}, 10, "observers.F r=1.theta"),
        ({"observers.F r=1.thteta": 1}, 8, "observers.F r=1.thteta"),
        ({"measurement.noise.0.terms.0.amplitude": "x"}, 16, "measurement.noise.0.terms.0.amplitude"),
        ({"time.end": -1}, 1, "time"),
        ({"observers.S.theta": None}, 12, "observers.S.theta"),
        ({"plant.initial": {"x1": 1}}, 6, "plant.initial"),
        ({"solver.step.size": 1}, 17, "solver.step.size"),
        ({"nonsense": 1}, None, "nonsense"),
    ],
)
def test_errors_keep_their_place(base: Experiment, changes: dict[str, Any], line: int | None, key: str) -> None:
    with pytest.raises(ConfigError) as error:
        _ = base.varied(changes).plant
    assert error.value.key == key
    assert line is None or error.value.line == line


def test_figures_and_claims_are_no_part_of_an_experiment() -> None:
    figures = {"a": {"panels": [{"state": "x1"}]}}
    claims = [{"id": "1", "claim": "c", "value": "rmse('o', x1)", "below": 1}]
    observers = {"o": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}}}
    plain = experiment(CONTOIS, observers)
    shown = experiment(CONTOIS, observers, figures=figures, claims=claims, title="t")
    assert not shown.blocks.figures
    assert not shown.blocks.claims
    assert shown.resolved_text == plain.resolved_text
    assert shown.varied({"seed": 2}).blocks.figures == {}
