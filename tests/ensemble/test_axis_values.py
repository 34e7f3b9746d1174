"""Values of axes that cannot be used are refused before anything runs, and others keep all their digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ensembles import base, ensemble

import hgorun
from hgorun.config.types import SEEDS
from hgorun.errors import ConfigError, Problem

VAN_DER_POL = """
time: {end: 0.2, output_step: 0.01}
plant: {type: van_der_pol, initial: {x1: 1, x2: -1}}
observers: {F: {type: fhgo2, theta: 3, r: 2}, S: {type: shgo, theta: 3}}
solver: {method: rk4, step: 2.0e-3}
"""


@pytest.mark.parametrize(
    ("path", "values", "message"),
    [
        ("observers.F.r", [1, 2, 2.5], "expected a whole number, found 2.5"),
        ("observers.F.r", [1, 2.0, 2], "expected a whole number, found 2.0"),
        ("seed", [1, 2, 1e3], "expected a whole number, found 1000.0"),
        ("seed", [5, SEEDS], "expected a number below 9223372036854775808, found 9223372036854775808"),
        ("seed", np.array([SEEDS, SEEDS + 1], dtype=np.uint64), "found 9223372036854775808"),
        ("observers.S.theta", np.array([np.nan, 2.0]), "expected finite numbers, found nan"),
    ],
)
def test_values_are_refused_as_they_were_written(tmp_path: Path, path: str, values: object, message: str) -> None:
    (tmp_path / "a.yaml").write_text(VAN_DER_POL)
    with pytest.raises(ConfigError, match=message):
        hgorun.sweep(hgorun.load(tmp_path / "a.yaml"), {path: values})


@pytest.mark.slow
@pytest.mark.parametrize("values", [[1, 2], ["1", "2"]])
def test_whole_numbers_may_be_text(tmp_path: Path, values: list[int | str]) -> None:
    (tmp_path / "a.yaml").write_text(VAN_DER_POL)
    found = hgorun.sweep(hgorun.load(tmp_path / "a.yaml"), {"observers.F.r": values})
    assert found.all_ok
    assert found.axes["observers.F.r"].tolist() == [1, 2]


def test_whole_numbers_among_others_are_numbers() -> None:
    ensemble({"observers.SHGO.theta": [2, 2.5]}).check()


def test_seeds_end_at_the_largest_one(tmp_path: Path) -> None:
    last = base().varied({"seed": SEEDS - 4})
    ensemble({"seed": {"count": 4}}, last).check()
    with pytest.raises(Problem, match="5 seeds from 9223372036854775804 on end above") as caught:
        ensemble({"seed": {"count": 5}}, last).check()
    assert caught.value.path == ("axes", "seed", "count")
    path = tmp_path / "a.yaml"
    path.write_text(f"{VAN_DER_POL}seed: {SEEDS - 4}\nruns:\n  fits: {{seeds: 4}}\n  many: {{seeds: 5}}\n")
    with pytest.raises(ConfigError, match=r"a.yaml:9: runs\.many\.seeds: 5 seeds from 9223372036854775804 on end"):
        hgorun.load_study(path)


@pytest.mark.slow
def test_seeds_keep_all_their_digits(tmp_path: Path) -> None:
    seeds = [2**53 + 1, 2**53 + 3, SEEDS - 1]
    output = tmp_path / "a.sweep.h5"
    found = hgorun.sweep(base(), {"seed": seeds}, output=output)
    for one in (found, hgorun.read_sweep(output.with_suffix(""))):
        assert one.axes["seed"].tolist() == seeds
        assert one.at("seed", str(2**53 + 1)).tolist() == [True, False, False]
    path = tmp_path / "a.yaml"
    path.write_text(f"{VAN_DER_POL}seed: {2**53 + 1}\nruns: {{many: {{seeds: 3}}}}\n")
    members = hgorun.load_study(path).runs["many"].members()
    assert [one.blocks.seed for one in members] == [2**53 + 1, 2**53 + 2, 2**53 + 3]


def test_any_number_of_spread_points_can_be_asked_for() -> None:
    axes = {"observers.SHGO.theta": {"log": [2, 20, 7]}, "seed": {"count": 7}}
    spread = ensemble(axes, combine="sobol")
    thetas = spread.values(0, 7)["observers.SHGO.theta"]  # warnings are errors
    pieces = [spread.values(start, stop)["observers.SHGO.theta"] for start, stop in ((0, 1), (1, 4), (4, 7))]
    assert np.concatenate(pieces).tolist() == thetas.tolist()


@pytest.mark.measured
@pytest.mark.slow
def test_truth_values_are_the_same_words_in_file_and_folder(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(VAN_DER_POL)
    output, path = tmp_path / "a.sweep.h5", "observers.S.theta"
    hgorun.sweep(hgorun.load(tmp_path / "a.yaml"), {path: [2.5, True]}, output=output)
    for found in (hgorun.read_sweep(output), hgorun.read_sweep(output.with_suffix(""))):
        assert found.axes[path].tolist() == ["2.5", "true"]
        assert found.at(path, True).tolist() == found.at(path, "true").tolist() == [False, True]
