"""``Experiment.varied``: the same but for some values."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import copy, deepcopy
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from examples import CONTOIS, Block, experiment, load

import hgorun
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
    ("rest", "value"), [("theta", 3), ("initial.x1", 2), ("initial", {"x1": 1, "x2": 13}), ("r", 2), ("theta", None)]
)
def test_a_path_of_all_observers_is_that_of_each_which_has_the_key(base: Experiment, rest: str, value: Any) -> None:
    base = base.varied({"observers.F r=1.r": 1})
    labels = [label for label, block in base.source.data["observers"].items() if rest.split(".")[0] in block]
    one_by_one = {f"observers.{label}.{rest}": value for label in labels}
    if value is None:
        with pytest.raises(ConfigError, match=r"observers\.F r=1\.theta: this key is missing"):
            base.varied({f"observers.*.{rest}": None})
        return
    assert base.varied({f"observers.*.{rest}": value}).resolved() == base.varied(one_by_one).resolved()


def test_a_key_that_no_observer_has_is_refused(base: Experiment) -> None:
    with pytest.raises(ConfigError) as error:
        base.varied({"observers.*.thta": 3})
    said = "observers.*.thta: no observer's block has the key 'thta'. Did you mean `theta`? Known here: "
    assert str(error.value).startswith(said)


def test_observers_are_the_changed_ones_beside_one_whose_equations_follow_the_outputs() -> None:
    bank: Block = {"type": "bank", "observer": {"type": "shgo"}, "thetas": [1, 2]}
    base = experiment(CONTOIS, {"A": bank, "S": {"type": "shgo", "theta": 1}})
    now = base.observers["A"]
    assert base.varied({"observers.S.theta": 3}).observers["S"].model_dump()["theta"] == 3
    assert base.varied({"observers.A.thetas.0": 1.5}).observers["A"].model_dump()["thetas"] == (1.5, 2)
    late = base.varied({"measurement": {"delay": 0.1}})
    assert type(late.observers["A"]) is not type(now)
    assert type(late.varied({"measurement": {}}).observers["A"]) is type(now)


@pytest.mark.parametrize(
    ("changes", "line", "key"),
    [
        ({"observers.F r=1.theta": -1}, 10, "observers.F r=1.theta"),
        ({"observers.F r=1.thteta": 1}, 8, "observers.F r=1.thteta"),
        ({"measurement.noise.0.terms.0.amplitude": "x"}, 16, "measurement.noise.0.terms.0.amplitude"),
        ({"time.end": -1}, 1, "time.end"),
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


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"observers.S.saturation.x2": 5}, "observers.S.saturation.x2"),
        ({"measurement.sampling.period": -1}, "measurement.sampling.period"),
        ({"figures": 5}, "figures"),
        ({"figures": {"1": {"panels": []}}}, "figures.1.panels"),
        ({"claims": [{}]}, "claims.0.id"),
        ({"extends": "a.yaml"}, "extends"),
    ],
)
def test_what_is_wrong_is_named_by_its_whole_path(base: Experiment, changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as error:
        base.varied(changes)
    assert error.value.key == key


def test_a_list_that_is_not_there_is_given_whole(base: Experiment) -> None:
    silent = base.varied({"measurement": None})
    with pytest.raises(ConfigError, match=r"there is no list `measurement.noise`: set the whole list"):
        silent.varied({"measurement.noise.0.amplitude": 1})


def test_a_design_is_made_once_for_a_family(base: Experiment) -> None:
    first, second = (base.varied({"plant.parameters.mu": mu}) for mu in (1.1, 1.2))
    assert first.designs["S"] is second.designs["S"]  # that of base may be forgotten, after many other tests
    assert base.varied({"observers.S.theta": 2}).designs["S"] is not base.designs["S"]
    starts = [e.designs["S"].initial(e.plant, has_alpha=a, recorded=()) for e in (first, second) for a in (False, True)]
    assert [start.size for start in starts] == [2, 3, 2, 3]
    assert all(np.array_equal(start[:2], [1, 14]) for start in starts)


@pytest.mark.slow
def test_threads_share_a_design(base: Experiment) -> None:
    """Each gets the start that belongs to its parameters, whatever the other one asks for."""
    design, plant = base.designs["S"], base.plant
    wanted = [design.initial(plant, has_alpha=a, recorded=()).size for a in (False, True)]
    both = Barrier(2)

    def sizes(has_alpha: bool) -> set[int]:
        both.wait()
        return {design.initial(plant, has_alpha=has_alpha, recorded=()).size for _ in range(20_000)}

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(2) as pool:
            assert list(pool.map(sizes, (False, True))) == [{size} for size in wanted]
    finally:
        sys.setswitchinterval(interval)


def test_blocks_that_have_not_changed_are_not_checked_again(base: Experiment) -> None:
    other = base.varied({"seed": 5})
    for name in ("time", "solver", "metrics"):
        assert getattr(other.blocks, name) is getattr(base.blocks, name), name
    assert base.varied({"time.end": 2}).blocks.time is not base.blocks.time


@pytest.mark.parametrize("copied", [lambda e: pickle.loads(pickle.dumps(e)), copy, deepcopy])
def test_an_experiment_that_was_used_can_be_pickled_and_copied(
    base: Experiment, copied: Callable[[Experiment], Experiment]
) -> None:
    for used in (base, base.varied({"observers.S.theta": 2})):
        first = hgorun.simulate(used)
        again = hgorun.simulate(copied(used))
        assert np.array_equal(again.observers["S"].xhat, first.observers["S"].xhat)
        assert again.config == first.config


def test_scalars_and_arrays_of_numpy_are_numbers_and_lists() -> None:
    def made(theta: object, poles: object, x1: object) -> Experiment:
        plant = CONTOIS | {"initial": {"x1": x1, "x2": 15}}
        return experiment(plant, {"S": {"type": "shgo", "theta": theta, "poles": poles}})

    plain = made(2, ["-1+2j", "-1-2j"], 1)
    of_numpy = made(np.float64(2), np.array([-1 + 2j, -1 - 2j]), np.int64(1))
    assert of_numpy.resolved() == plain.resolved()
    changes = {"observers.S.theta": np.int64(3), "observers.S.poles": (np.float64(-1), np.float64(-2))}
    varied = plain.varied(changes)
    assert varied.resolved() == plain.varied({"observers.S.theta": 3, "observers.S.poles": [-1, -2]}).resolved()


@pytest.mark.parametrize(
    ("changes", "found"),
    [(["seed=2"], "a list"), ([("seed", 2)], "a list"), ("seed=2", "'seed=2'"), ({1: 2}, "a mapping")],
)
@pytest.mark.parametrize("seed", [None, 3])
def test_changes_are_values_by_paths(changes: Any, found: str, seed: int | None) -> None:
    with pytest.raises(ConfigError) as error:
        experiment(CONTOIS, {"S": {"type": "shgo", "theta": 1}}).varied(changes, seed=seed)
    right = 'such as {"observers.SHGO.theta": 2}'
    assert str(error.value) == f"changes: expected a mapping of values by their paths, {right}, found {found}"
