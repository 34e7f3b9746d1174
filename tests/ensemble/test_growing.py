"""Ensembles as they are read in Python, finished or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ensembles import base, ensemble, small

import hgorun
from hgorun.ensemble.blocks.carried import carry_out
from hgorun.ensemble.collected.outcome import outcome_of
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.recipe import recipe_of
from hgorun.ensemble.sweep import Place, sweep_to
from hgorun.errors import ConfigError

AXES = {"observers.SHGO.theta": {"log": [2, 20, 4]}, "seed": {"count": 3}}


@pytest.mark.costly
def test_a_call_gives_the_members_with_labels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = hgorun.sweep(base(), AXES, {"metrics": ["rmse"]})
    assert [path for path in tmp_path.iterdir() if not path.name.startswith(".coverage")] == []
    assert (len(found), found.dimensions) == (12, {"observers.SHGO.theta": 4, "seed": 3})
    labelled = found.to_xarray()
    assert labelled["rmse"].dims == ("observers.SHGO.theta", "seed", "observer", "state")
    for i in (0, 5, 11):
        place = {path: values[i] for path, values in found.axes.items()}
        assert np.array_equal(labelled["rmse"].sel(place).values, found.metrics["rmse"][i])
        one = hgorun.simulate(base().varied({path: value.item() for path, value in place.items()}))
        assert found.metrics["rmse"][i, 1].tolist() == one.observers["FHGO"].metrics["rmse"].tolist()
    assert labelled["rmse"].mean("seed").sizes["observers.SHGO.theta"] == 4


@pytest.mark.slow
def test_a_call_with_a_file_goes_on_where_it_was(tmp_path: Path) -> None:
    output = tmp_path / "a.sweep.h5"
    first = hgorun.sweep(base(), AXES, output=output)
    before = {p.name: p.stat().st_mtime_ns for p in (tmp_path / "a.sweep" / "blocks").iterdir()}
    again = hgorun.sweep(base(), AXES, output=output)
    assert {p.name: p.stat().st_mtime_ns for p in (tmp_path / "a.sweep" / "blocks").iterdir()} == before
    assert np.array_equal(first.metrics["rmse"], again.metrics["rmse"])
    with pytest.raises(hgorun.HgorunError, match="holds members of something else"):
        hgorun.sweep(base(), {**AXES, "seed": {"count": 2}}, output=output)
    assert len(hgorun.sweep(base(), {**AXES, "seed": {"count": 2}}, output=output, fresh=True)) == 8


@pytest.mark.costly
def test_arrays_of_numpy_are_axes() -> None:
    found = hgorun.sweep(base(), {"observers.SHGO.theta": np.array([2.0, 3.0]), "seed": range(2)}, combine="zip")
    assert found.axes["seed"].tolist() == [0, 1]
    labelled = found.to_xarray()
    assert labelled["rmse"].dims == ("member", "observer", "state")
    assert labelled["observers.SHGO.theta"].values.tolist() == [2, 3]


def test_what_is_wrong_with_a_call_is_said_by_its_key() -> None:
    with pytest.raises(ConfigError, match=r"^axes\.observers\.X\.theta: "):
        hgorun.sweep(base(), {"observers.X.theta": [1]})
    with pytest.raises(ConfigError, match=r"keep\.metrics\.0: no metric is called 'rms'"):
        hgorun.sweep(base(), {"seed": [1]}, {"metrics": ["rms"]})


def test_a_folder_is_read_while_it_grows(tmp_path: Path) -> None:
    of = small(trajectories={"every": 5})
    store = Store.opened(tmp_path / "a.sweep", of)
    with pytest.raises(ConfigError, match="no member is finished yet"):
        hgorun.read_sweep(store.folder)
    store.write(carry_out(recipe_of(of), 8, 11))
    store.write(carry_out(recipe_of(of), 2, 6))
    found = hgorun.read_sweep(store.folder)
    assert (len(found), found.planned, found.dimensions) == (7, 12, {})
    assert found.axes["seed"].tolist() == [2, 0, 1, 2, 2, 0, 1]
    assert found.trajectories is not None
    assert found.trajectories.member.tolist() == [3, 6]  # members 5 and 10
    assert found.to_xarray()["rmse"].dims == ("member", "observer", "state")
    with pytest.raises(ConfigError, match="its numbers take more than"):
        hgorun.read_sweep(store.folder, max_memory=10)


@pytest.mark.costly
def test_a_folder_that_is_whole_reads_like_its_file(tmp_path: Path) -> None:
    place = Place.of(tmp_path / "a.h5")
    sweep_to(small(trajectories={"every": 5}), place)
    folder, file = hgorun.read_sweep(place.folder), hgorun.read_sweep(place.file)
    assert folder.dimensions == file.dimensions == {"observers.*.theta": 4, "seed": 3}
    assert folder.to_xarray().identical(file.to_xarray())
    assert folder.families == file.families
    assert (folder.trajectories is None, file.trajectories is None) == (False, False)


@pytest.mark.costly
def test_an_ensemble_may_be_of_a_plant_alone(tmp_path: Path) -> None:
    place = Place.of(tmp_path / "a.h5")
    alone = base().varied({"observers.SHGO": None, "observers.FHGO": None})
    sweep_to(ensemble({"plant.initial.x1": [1.0, 2.0]}, alone, keep={"trajectories": "all"}), place)
    found = hgorun.read_sweep(place.file)
    assert found.metrics["rmse"].shape == (2, 0, 2)
    assert found.trajectories is not None
    assert found.trajectories.x[:, 0, 0].tolist() == [1, 2]
    told = outcome_of(place.file)
    assert (told.members, told.failed, told.observers, told.status) == (2, 0, {}, "ok")


@pytest.mark.costly
def test_text_is_an_axis_too(tmp_path: Path) -> None:
    place = Place.of(tmp_path / "a.h5")
    sweep_to(ensemble({"solver.method": ["rk4", "euler"], "observers.FHGO.delta": [3, 4.5]}), place)
    found = hgorun.read_sweep(place.file).to_xarray()
    assert found["solver.method"].values.tolist() == ["rk4", "euler"]
    assert found["observers.FHGO.delta"].values.tolist() == [3, 4.5]


def test_a_file_of_another_kind_is_not_replaced_by_an_ensemble(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"output: expected the name of a file \.h5, .*, found .*plant\.csv"):
        hgorun.sweep(base(), AXES, output=tmp_path / "plant.csv")
    assert not list(tmp_path.iterdir())
