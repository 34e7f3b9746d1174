"""An inherited key is removed by null, in a file as with --set."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun.config.reading import read_source
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.study.loading import load_study

BASE = """\
time: {end: 1, output_step: 0.1}
plant: {type: integrator_chain, n: 2, initial: {x1: 1, x2: 0}}
measurement: {noise: [{type: gaussian, std: 0.1}], sampling: {period: 0.1}, delay: 0.2}
observers:
  S: {type: shgo, theta: 2}
  F: {type: shgo, theta: 4}
solver: {step: 0.1}
"""


def load_all(path: Path, overrides: tuple[str, ...] = ()) -> list[Experiment]:
    return [run.experiment for run in load_study(path, overrides).runs.values()]


@pytest.fixture
def write(tmp_path: Path) -> Path:
    (tmp_path / "base.yaml").write_text(BASE)
    return tmp_path / "over.yaml"


@pytest.mark.parametrize("null", ["null", "~"])
def test_what_a_file_extends_is_removed_by_null(write: Path, null: str) -> None:
    write.write_text(f"extends: base.yaml\nmeasurement: {{delay: {null}, noise: {null}}}\nobservers: {{F: {null}}}\n")
    data = read_source(write, ())[1].data
    assert data["measurement"] == {"sampling": {"period": 0.1}}
    assert list(data["observers"]) == ["S"]
    further = write.with_name("further.yaml")
    further.write_text("extends: over.yaml\nmeasurement: null\nobservers: {F: {type: shgo, theta: 8}}\n")
    data = read_source(further, ())[1].data
    assert "measurement" not in data
    assert data["observers"]["F"] == {"type": "shgo", "theta": 8}


@pytest.mark.parametrize(
    "over",
    [
        "measurement: {delay: &none null, noise: *none}\nobservers: {F: *none}\n",
        "runs: {a: &a {measurement: {delay: null, noise: ~}, observers: {F: null}}, b: *a}\n",
    ],
    ids=["of the value itself", "of a mapping with it"],
)
def test_null_removes_through_an_alias_as_well(write: Path, over: str) -> None:
    write.write_text("extends: base.yaml\n" + over)
    for one in load_all(write):
        assert one.source.data["measurement"] == {"sampling": {"period": 0.1}}
        assert list(one.observers) == ["S"]


def test_a_run_removes_what_the_file_has(write: Path) -> None:
    write.write_text(BASE + "runs:\n  late: {}\n  early: {measurement: {delay: null}, observers: {F: ~}}\n")
    late, early = load_all(write)
    assert list(late.observers) == ["S", "F"]
    assert list(early.observers) == ["S"]
    changed = load_all(write, ("observers.S.theta=3",))[1]  # an assignment does not bring it back
    assert list(changed.observers) == ["S"]
    assert [run.resolved()["measurement"].get("delay") for run in (late, early)] == ["0.2", None]


def test_a_key_that_has_to_be_there_names_who_removes_it(write: Path) -> None:
    write.write_text("extends: base.yaml\n# without a plant\nplant: null\n")
    with pytest.raises(ConfigError) as caught:
        load_all(write)
    assert str(caught.value).startswith(f"{write}:3: plant: ")


def test_nothing_at_all_removes_nothing(write: Path) -> None:
    """It may be what is left of a block whose lines are comments."""
    write.write_text("extends: base.yaml\nmeasurement:\n  # delay: 0.1\n")
    with pytest.raises(ConfigError, match="measurement: this key has no value"):
        load_all(write)
    write.write_text("extends: base.yaml\ncontroller: null\n")
    with pytest.raises(ConfigError, match="controller: "):
        load_all(write)
