"""``hgorun benchmark``: scores against runs made one by one, what is carried out again, and what is written."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hgorun
from hgorun.benchmark.benchmark import Benchmark, load_benchmark
from hgorun.benchmark.contestants import absent, contestant_in, contestants
from hgorun.benchmark.trial import Trial
from hgorun.commands.benchmark import _write, benchmark
from hgorun.commands.ensemble_options import Bench
from hgorun.config.benchmark import Contestant
from hgorun.errors import ConfigError, HgorunError
from hgorun.observers.base import OBSERVERS
from hgorun.observers.ekf import ExtendedKalmanFilter
from hgorun.observers.piecewise import PiecewiseObserver

PLANT: dict[str, Any] = {
    "time": {"end": 3, "output_step": 0.05},
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0},
    },
    "observers": {"any": {"type": "shgo", "theta": 1, "initial": {"x1": 0.5, "x2": 0.5}}},
    "solver": {"method": "rk4", "step": 0.01},
    "runs": {
        "held": {"measurement": {"noise": [{"type": "gaussian", "std": 0.05, "hold": 0.05}]}},
        "sampled": {"measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.05}]}},
    },
}
BENCHMARK: dict[str, Any] = {
    "plants": {"oscillator": {"file": "plant.yaml", "rate": 2}},
    "scenarios": ["held", "sampled"],
    "seeds": {"first": 7, "tuning": 4, "scoring": 5},
    "tries": {"coarse": 4, "fine": 3},
    "observers": {
        "S": {"group": "high gain", "knob": {"range": {"log": [0.5, 8]}}, "block": {"type": "shgo"}},
        "G": {
            "group": "differentiator",
            "knob": {"key": "window", "range": {"log": [3, 5]}, "rate": False, "whole": True},
            "block": {"type": "savgol", "degree": 1},
        },
    },
}

SHGO: dict[str, Any] = {"group": "g", "block": {"type": "shgo"}}


def written(folder: Path, **changes: Any) -> Path:
    path = folder / "small.yaml"
    (folder / "plant.yaml").write_text(yaml.safe_dump(PLANT), encoding="utf-8")
    path.write_text(yaml.safe_dump(BENCHMARK | changes, sort_keys=False), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Benchmark]:
    folder = tmp_path_factory.mktemp("benchmark")
    path = written(folder)
    assert benchmark(Bench(file=path, output=folder, quiet=True)) == 0
    return folder, load_benchmark(path)


@pytest.mark.slow
def test_scores_are_those_of_runs_made_one_by_one(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    entry = asked.entries(folder / "small" / "entries")[0]
    assert entry.score is not None
    base = hgorun.load(folder / "plant.yaml", run="held")
    x = hgorun.simulate(base).x
    for k, seed in enumerate(range(11, 16)):
        run = hgorun.simulate(
            base.varied({"observers.any.theta": entry.score.value, "solver": {"method": "auto"}}, seed=seed)
        )
        error = (run.observers["any"].xhat - run.x) / x.std(axis=0)
        assert entry.score.total[k] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-2)
        late = run.time >= 1
        assert entry.score.steady[k] == pytest.approx(np.sqrt(np.mean(error[late] ** 2)), rel=1e-2)


@pytest.mark.costly
def test_the_knob_is_the_best_that_was_tried(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    for entry in asked.entries(folder / "small" / "entries"):
        if entry.score is not None:
            value, _ = min(entry.score.tried, key=lambda pair: np.mean(pair[1]))
            assert entry.score.value == value


@pytest.mark.costly
def test_what_does_not_take_a_scenario_says_why(tmp_path: Path) -> None:
    one = {"I": {"group": "g", "knob": {"range": {"log": [0.5, 8]}}, "block": {"type": "impulsive"}}}
    held, sampled = load_benchmark(written(tmp_path, observers=one)).entries(tmp_path / "entries")
    assert "needs sampled outputs" in held.refused
    assert sampled.score is not None


@pytest.mark.slow
def test_only_what_is_new_is_carried_out(done: tuple[Path, Benchmark], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, _ = done
    carried: list[str] = []
    score = Trial.score

    def watched(trial: Trial, *rest: Any) -> Any:
        carried.append(trial.label)
        return score(trial, *rest)

    monkeypatch.setattr(Trial, "score", watched)
    path = folder / "small.yaml"
    assert benchmark(Bench(file=path, output=folder, quiet=True, plots=False)) == 0
    assert carried == []
    more = BENCHMARK["observers"] | {"T": {"group": "high gain", "block": {"type": "fhgo2", "r": 1}}}
    path.write_text(yaml.safe_dump(BENCHMARK | {"observers": more}, sort_keys=False), encoding="utf-8")
    assert benchmark(Bench(file=path, output=folder, quiet=True, plots=False)) == 0
    assert carried == ["T", "T"]
    written(folder)


def test_a_damaged_entry_is_made_again(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    place = folder / "small" / "entries"
    before = asked.entries(place)
    one = min(place.iterdir())
    one.write_text("{", encoding="utf-8")
    assert asked.entries(place) == before


@pytest.mark.costly
def test_what_fails_does_not_stop_the_others(
    done: tuple[Path, Benchmark], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _, asked = done
    score = Trial.score

    def failing(trial: Trial, *rest: Any) -> Any:
        if trial.label == "S":
            raise HgorunError("the design is not finite")
        return score(trial, *rest)

    monkeypatch.setattr(Trial, "score", failing)
    for _ in range(2):  # made, and read again
        entries = {(e.scenario, e.label): e for e in asked.entries(tmp_path)}
        assert entries["sampled", "S"].refused == "failed: the design is not finite"
        assert entries["sampled", "G"].score is not None
        monkeypatch.setattr(Trial, "score", score)


def test_who_keeps_the_estimate_with_no_value_says_so(tmp_path: Path) -> None:
    wild = {"S": {"group": "g", "knob": {"range": {"log": [400, 4000]}}, "block": {"type": "shgo"}}}
    path = written(tmp_path, observers=wild, scenarios=["sampled"])
    (entry,) = load_benchmark(path).entries(tmp_path / "entries")
    assert entry.refused == "failed: diverges with each of 4 values of theta between 800 and 8e+03"


def test_a_contestant_may_be_made_for_some_scenarios(tmp_path: Path) -> None:
    one = {"S": {"group": "g", "scenarios": ["sampled"], "block": {"type": "shgo"}}}
    path = written(tmp_path, observers=one, scenarios=["held"], plants={"oscillator": {"file": "plant.yaml"}})
    with pytest.raises(ConfigError, match="no scenario is called 'sampled'"):
        load_benchmark(path)
    path = written(tmp_path, observers=one, seeds={"tuning": 2, "scoring": 2})
    held, sampled = load_benchmark(path).entries(tmp_path / "entries")
    assert held.refused == "made for sampled only"
    assert sampled.score is not None


def test_observers_that_the_file_does_not_name_take_part(tmp_path: Path) -> None:
    others = {"knobs": [{"key": "theta"}, {"key": "G", "rate": False}]}
    blocks = load_benchmark(written(tmp_path, others=others, without={"fhgo2": "not today"})).blocks
    found, gone = contestants(blocks), absent(blocks)
    named = {one.block["type"] for one in found.values()}
    assert named | gone.keys() == set(OBSERVERS.names())
    assert named.isdisjoint(gone)
    assert gone["fhgo2"] == "not today"
    assert gone["deadbeat"] == "none of its keys is a knob (theta, G)"
    assert found["levant"].group == "differentiator"
    assert found["levant"].knob.key == "G"
    alone = load_benchmark(written(tmp_path)).blocks
    assert list(contestants(alone)) == ["S", "G"]
    assert absent(alone)["fhgo2"] == "the file does not name it"


def test_keys_that_follow_the_knob_and_keys_of_the_example(tmp_path: Path) -> None:
    asked = load_benchmark(written(tmp_path))
    base = asked.bases["oscillator", "held"]
    two = Contestant.model_validate(
        {"group": "g", "knob": {"key": "theta_2", "follow": {"theta_1": 3}}, "block": {"type": "piecewise"}}
    )
    block = contestant_in(base, "P", two, 2.0).observers["P"]
    assert isinstance(block, PiecewiseObserver)
    assert block.theta_1 == pytest.approx(3 * block.theta_2)
    needs = Contestant.model_validate({"group": "g", "block": {"type": "cascade"}})
    assert contestant_in(base, "C", needs, 2.0).observers["C"].type == "cascade"


def test_a_plant_may_have_a_knob_and_keys_of_its_own(tmp_path: Path) -> None:
    asked = load_benchmark(written(tmp_path))
    base, own = asked.bases["oscillator", "sampled"], {"key": "Q.x2", "range": {"log": [0.01, 100]}, "rate": False}
    blocks = {"group": "g", "block": {"type": "ekf"}, "plants": {"oscillator": {"knob": own, "block": {"R": 0.5}}}}
    one = Contestant.model_validate(blocks)
    there, elsewhere = one.on("oscillator"), one.on("motor")
    observer = contestant_in(base, "K", there, 2.0).observers["K"]
    assert isinstance(observer, ExtendedKalmanFilter)
    assert (observer.Q, observer.R, observer.theta) == ({"x2": 1.0}, 0.5, None)
    assert elsewhere.knob.key == "theta"
    assert elsewhere.block == {"type": "ekf"}
    many = {"key": "thetas.1", "range": {"log": [1, 4]}, "rate": False}
    bank = {"type": "bank", "observer": {"type": "shgo"}, "thetas": [1, 3]}
    modes = contestant_in(base, "B", Contestant.model_validate({"group": "g", "knob": many, "block": bank}), 2.0)
    assert modes.observers["B"].model_dump()["thetas"] == (1, 2)


def test_cost_is_that_of_a_step(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    entry = asked.entries(folder / "small" / "entries")[0]
    assert entry.score is not None
    assert 1 < entry.score.nanoseconds < 1e6
    with (folder / "small" / "entries.csv").open(encoding="utf-8") as file:
        row = next(csv.DictReader(file))
    assert 1 < float(row["ns_per_step"]) < 1e6  # another test may have measured the entry anew
    assert float(row["error_low"]) < float(row["error"]) < float(row["error_high"])


def test_files_and_json(done: tuple[Path, Benchmark], capsys: pytest.CaptureFixture[str]) -> None:
    folder, _ = done
    assert benchmark(Bench(file=folder / "small.yaml", output=folder, json=True)) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == {"name", "files", "observers", "entries"}
    assert told["observers"]["S"]["held"]["ratio"] == 1
    with (folder / "small" / "entries.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["scenario"], row["observer"]) for row in rows] == [
        ("held", "S"),
        ("held", "G"),
        ("sampled", "S"),
        ("sampled", "G"),
    ]
    assert (folder / "small" / "fronts.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scenarios": ["held", "gone"]}, "gone"),
        ({"plants": {}}, "plants"),
        ({"observers": {"S": {"group": "g", "block": {"theta": 1}}}}, "type"),
        ({"observers": {"S": {"group": "g", "block": {"type": "shgo", "theta": 1}}}}, "it is tuned"),
        ({"observers": {"S": {"group": "g", "block": {"type": "shgo", "initial": {}}}}}, "plant's file"),
        ({"observers": {"S": {"group": "g", "block": {"type": "none"}}}, "scenarios": ["held"]}, "none"),
        ({"seeds": {"tuning": 0}}, "tuning"),
        ({"observers": {"S": SHGO | {"plants": {"moon": {}}}}}, "'moon'"),
        ({"observers": {"S": SHGO | {"plants": {"oscillator": {"block": {"theta": 1}}}}}}, "it is tuned"),
    ],
)
def test_what_is_wrong_in_the_file_is_named(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_benchmark(written(tmp_path, **change))


def test_a_plant_gives_one_initial_estimate(tmp_path: Path) -> None:
    path = written(tmp_path)
    two = PLANT["observers"] | {"other": {"type": "shgo", "theta": 2}}
    (tmp_path / "plant.yaml").write_text(yaml.safe_dump(PLANT | {"observers": two}), encoding="utf-8")
    with pytest.raises(ConfigError, match="expected one observer"):
        load_benchmark(path)


def test_without_plots_there_are_the_tables_only(tmp_path: Path) -> None:
    asked = load_benchmark(written(tmp_path))
    files = _write(asked, [], {}, tmp_path, page=None)
    assert [file.name for file in files] == ["standings.md", "entries.csv"]
    assert all(file.exists() for file in files)
