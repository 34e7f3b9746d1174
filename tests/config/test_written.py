"""Configurations with other numbers in them."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from hgorun import load
from hgorun.config.reading import read_source
from hgorun.config.written import beside, with_values
from hgorun.study.loading import load_study

PLAIN = """\
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers:
  # é, before
  F: {type: shgo, theta: "2*2", poles: [-1, -2]}  # behind
  G: {type: shgo, theta: 3}
"""


def theta(path: Path, label: str = "F", run: str | None = None) -> float:
    return float(load(path, run=run).observers[label].theta)  # type: ignore[attr-defined]  # of this family


def test_numbers_take_the_place_of_others(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(PLAIN)
    found = with_values(path, {"observers.F.theta": 5.25, "observers.F.poles.1": -3.0}, tmp_path / "b.yaml")
    assert found == PLAIN.replace('"2*2"', "5.25").replace("-2]", "-3]")


def test_a_file_that_is_extended_is_found_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(PLAIN)
    own = tmp_path / "own.yaml"
    own.write_text("extends: base.yaml  # the base\nobservers: {F: {theta: 7}}\n")
    target = tmp_path / "results" / "own.tuned.yaml"
    target.parent.mkdir()
    target.write_text(with_values(own, {"observers.F.theta": 8.5}, target))
    assert target.read_text() == "extends: '../base.yaml'  # the base\nobservers: {F: {theta: 8.5}}\n"
    assert theta(target) == 8.5
    target.write_text(with_values(own, {"observers.G.theta": 1.5}, target))  # which stands in the base
    assert target.read_text().startswith("extends: ../own.yaml\n")
    assert (theta(target), theta(target, "G")) == (7.0, 1.5)


def test_a_number_that_stands_for_several_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(PLAIN.replace('"2*2"', "&t 4").replace("theta: 3", "theta: *t"))
    target = tmp_path / "b.yaml"
    target.write_text(with_values(path, {"observers.F.theta": 5.0}, target))
    assert (theta(target), theta(target, "G")) == (5.0, 4.0)


@pytest.mark.parametrize("inside", [True, False])
def test_a_run_has_numbers_of_its_own(tmp_path: Path, inside: bool) -> None:
    path = tmp_path / "a.yaml"
    own = "observers: {F: {theta: 6}}" if inside else "seed: 3"
    path.write_text(f"{PLAIN}runs:\n  one: {{{own}}}\n  two: {{}}\n")
    target = tmp_path / "b.yaml"
    target.write_text(with_values(path, {"observers.F.theta": 5.5}, target, run="one"))
    assert theta(target, run="one") == 5.5
    assert list(load_study(target).runs) == ["one", "two"]
    if inside:
        assert theta(target, run="two") == 4.0


RECORDED = """\
plant: {states: [a], dynamics: {a: -a}, output: a}
data:
  file: FILES
  time: t
  outputs: {a: {column: a, file: sub/a.csv}}  # measured
  reference: {a: {column: a, file: /lab/b.csv}}
observers: {F: {type: shgo, theta: 3, poles: -1}}
"""


@pytest.mark.parametrize("files", ["log.csv", "[one.csv, two.csv]"])
def test_files_with_data_are_found_from_elsewhere(tmp_path: Path, files: str) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(RECORDED.replace("FILES", files))
    (tmp_path / "over.yaml").write_text("extends: own.yaml\nobservers: {F: {theta: 4}}\n")
    target = tmp_path / "results" / "tuned.yaml"
    target.parent.mkdir()
    for path, number in ((own, "theta"), (own, "eta"), (tmp_path / "over.yaml", "theta")):
        target.write_text(with_values(path, {f"observers.F.{number}": 5.0}, target))
        found = yaml.safe_load(target.read_text())
        names = found["data"]["file"] if files[0] == "[" else [found["data"]["file"]]
        named = [(target.parent / name).resolve().relative_to(tmp_path.resolve()).name for name in names]
        assert named == files.strip("[]").split(", ")
        assert (target.parent / found["data"]["outputs"]["a"]["file"]).resolve() == (tmp_path / "sub/a.csv").resolve()
        assert read_source(target)[1].data["data"]["reference"]["a"]["file"] == "/lab/b.csv"
        assert found["observers"]["F"][number] == 5.0
    beside = with_values(own, {"observers.F.theta": 5.0}, tmp_path / "b.yaml")
    assert beside == own.read_text().replace("theta: 3", "theta: 5")


@pytest.mark.parametrize(
    ("overrides", "kept"),
    [
        (["data.time=u", "observers.F.theta=7"], True),  # single values of the file: its own text
        (["data.outputs.a.std=0.1"], False),
        (["observers.G={type: fhgo1, theta: 2, r: 1, poles: -1}"], False),
        (["observers.F={type: fhgo2, theta: 2, r: 1, poles: [-1, -2]}"], False),  # in place of another type
        (["observers.F={type: shgo, theta: 2}"], False),  # without poles
        (["data.reference=null", "observers.F.poles=null"], False),
        (["data.file=[c.csv, d.csv]"], False),
        (["plant={type: van_der_pol, initial: {x1: 1, x2: 0}}", "data.outputs={x1: x1}"], False),
    ],
)
@pytest.mark.parametrize("folder", [".", "results"])
def test_assignments_are_in_the_text(tmp_path: Path, folder: str, overrides: list[str], kept: bool) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(RECORDED.replace("FILES", "log.csv"))
    target = tmp_path / folder / "tuned.yaml"
    target.parent.mkdir(exist_ok=True)
    label = "G" if "observers.G" in overrides[0] else "F"
    text = with_values(path, {f"observers.{label}.theta": 5.0}, target, overrides=overrides)
    assert ("# measured" in text) == kept
    target.write_text(text)
    wanted = read_source(path, [*overrides, f"observers.{label}.theta=5"])[1]
    found = {key: value for key, value in read_source(target)[1].data.items() if key != "extends"}
    assert found == (wanted.data if folder == "." else beside(wanted, tmp_path, target.parent))


def test_numbers_have_all_their_digits(tmp_path: Path) -> None:
    path, target = tmp_path / "a.yaml", tmp_path / "b.yaml"
    path.write_text(PLAIN)
    for value in (0.1 + 0.2, 1e-7 / 3, 12345678.0, 5e22):
        target.write_text(with_values(path, {"observers.F.theta": value}, target))
        assert theta(target) == value


def test_a_list_on_top_of_another_is_whole(tmp_path: Path) -> None:
    """One of its values would otherwise be a mapping in the place of the list."""
    (tmp_path / "base.yaml").write_text(PLAIN)
    own, target = tmp_path / "own.yaml", tmp_path / "b.yaml"
    own.write_text("extends: base.yaml\n")
    target.write_text(with_values(own, {"observers.F.poles.1": -3.5, "observers.F.theta": 2.0}, target))
    found = load(target).observers["F"]
    assert (found.poles, found.theta) == ((-1, -3.5), 2.0)  # type: ignore[attr-defined]  # of this family
