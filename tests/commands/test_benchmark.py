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
from hgorun.benchmark.trial import Trial
from hgorun.commands.benchmark import benchmark
from hgorun.commands.ensemble_options import Bench
from hgorun.errors import ConfigError, HgorunError

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


def test_the_knob_is_the_best_that_was_tried(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    for entry in asked.entries(folder / "small" / "entries"):
        if entry.score is not None:
            value, _ = min(entry.score.tried, key=lambda pair: pair[1])
            assert entry.score.value == value


def test_what_does_not_take_a_scenario_says_why(done: tuple[Path, Benchmark]) -> None:
    folder, asked = done
    entries = {(e.scenario, e.label): e for e in asked.entries(folder / "small" / "entries")}
    assert "needs sampled outputs" in entries["held", "G"].refused
    assert entries["sampled", "G"].score is not None


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
    entries = {(e.scenario, e.label): e for e in asked.entries(tmp_path)}
    assert entries["sampled", "S"].refused == "failed: the design is not finite"
    assert entries["sampled", "G"].score is not None


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
        ({"seeds": {"tuning": 0}}, "tuning"),
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
