"""What a program of Python gives where a file is expected, and names that it has for what is called otherwise here."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hgorun
from hgorun.errors import ConfigError
from hgorun.result.records.observer import ObserverResult

BLOCKS: dict[str, Any] = {
    "time": {"end": 1, "output_step": 0.1},
    "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
    "measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]},
    "observers": {"S": {"type": "shgo", "theta": 2}},
}


def test_a_mapping_is_loaded_as_a_file_with_the_same_keys(tmp_path: Path) -> None:
    (tmp_path / "experiment.yaml").write_text(yaml.safe_dump(BLOCKS))
    before = copy.deepcopy(BLOCKS)
    found = hgorun.load(BLOCKS, ["observers.S.theta=3"], seed=7)
    from_file = hgorun.load(tmp_path / "experiment.yaml", ["observers.S.theta=3"], seed=7)
    assert found.source.data == from_file.source.data
    assert (found.name, BLOCKS) == (from_file.name, before)
    lacking = {key: block for key, block in BLOCKS.items() if key != "time"}
    assert hgorun.load(lacking, ["time={end: 1, output_step: 0.1}"]).time.end == 1.0


def test_a_seed_for_one_simulation(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(BLOCKS))
    right = hgorun.simulate(hgorun.load(tmp_path / "a.yaml", seed=3)).observers["S"].xhat
    for given in (BLOCKS, tmp_path / "a.yaml", hgorun.Experiment(BLOCKS)):
        assert np.array_equal(hgorun.simulate(given, seed=3).observers["S"].xhat, right)
        assert not np.array_equal(hgorun.simulate(given).observers["S"].xhat, right)


@pytest.mark.parametrize(
    ("given", "more", "said"),
    [
        (3, {}, "load: expected a file or a mapping, found 3"),
        (BLOCKS, {"run": "a"}, "run names one of the runs of a file"),
        ({"runs": {}}, {}, "a mapping holds one run; with several `runs` it has to be a file"),
        ({"extends": "a.yaml"}, {}, "only a file can extend another one"),
        (BLOCKS, {"overrides": "seed=1"}, "overrides: expected a list, such as"),
        (BLOCKS, {"overrides": {"seed": 1}}, "expected a list, such as ['seed=1'], found a mapping; varied(...)"),
        (BLOCKS, {"overrides": [("seed", 1)]}, "overrides: expected a list of texts path=value, found a list in it"),
        (
            BLOCKS | {"plant": {"typ": "contois"}},
            {},
            "a model: states, dynamics, output; found 'typ'. Did you mean `type`?",
        ),
        (BLOCKS | {"figures": {"f": {"draws": 1}}}, {}, "figures"),
    ],
)
def test_what_cannot_be_loaded(given: Any, more: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        hgorun.load(given, **more)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (BLOCKS, "load_study: expected a file, found a mapping; hgorun.load takes the blocks of one run"),
        (None, "load_study: expected a file, found nothing"),
    ],
)
def test_a_study_is_a_file(given: Any, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        hgorun.load_study(given)
    assert str(caught.value) == said


def test_a_run_keeps_the_keys_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(yaml.safe_dump(BLOCKS | {"runs": {"own": {"seed": 3}, "none": {"title": "other"}}}))
    for overrides, seed, seeds in (([], 7, (3, 7)), (["runs.own.seed=5"], None, (5, 0))):
        runs = hgorun.load_study(file, overrides, seed=seed).runs
        assert tuple(runs[name].experiment.blocks.seed for name in ("own", "none")) == seeds


@pytest.mark.parametrize(
    ("given", "run", "said"),
    [
        (hgorun.Experiment(BLOCKS), "a", "run names one of the runs of a file"),
        (3, None, "experiment: expected a file, a mapping or an Experiment, found 3"),
    ],
)
def test_what_cannot_be_simulated(given: Any, run: str | None, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        hgorun.simulate(given, run=run)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("compare", "`result.metrics()` of hgorun.simulate has the numbers"),
        ("tune", "it is a command only, `hgorun tune` in a shell"),
        ("run", "hgorun.simulate runs an experiment, and hgorun.sweep an ensemble"),
    ],
)
def test_a_function_that_there_is_under_another_name(name: str, said: str) -> None:
    with pytest.raises(AttributeError) as caught:
        getattr(hgorun, name)
    assert str(caught.value).startswith(f"module 'hgorun' has no attribute '{name}': {said}")
    with pytest.raises(AttributeError, match=r"has no attribute 'zzz'$"):
        hgorun.zzz  # noqa: B018  # asking for it is what is tested


def test_the_estimate_of_an_observer_is_called_xhat() -> None:
    one = ObserverResult(type="shgo", xhat=np.zeros((2, 1)), internal={}, gains={}, dimension=1)
    with pytest.raises(AttributeError, match=r"the result of an observer has no 'x'; the estimate is `xhat`$"):
        getattr(one, "x")  # noqa: B009  # a type checker knows that it is not there
    with pytest.raises(AttributeError, match=r"the result of an observer has no 'zzz'$"):
        getattr(one, "zzz")  # noqa: B009
    assert copy.copy(one).type == "shgo"
