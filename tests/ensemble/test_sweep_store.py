"""The folder of an ensemble: blocks that never change, and nothing that is not noticed."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ensembles import base, ensemble, small

from hgorun.ensemble import fingerprint, store
from hgorun.ensemble.carried import Carried, carry_out, from_bytes, to_bytes
from hgorun.ensemble.recipe import ensemble_of, recipe_of
from hgorun.ensemble.store import Changed, Damaged, Store
from hgorun.errors import ConfigError, HgorunError
from hgorun.result.metrics.base import METRICS, Metric


def carried(start: int, stop: int) -> Carried:
    return carry_out(recipe_of(small()), start, stop)


def test_a_block_is_read_as_it_was_written() -> None:
    one = carry_out(recipe_of(small(trajectories={"every": 2})), 1, 6)
    content = to_bytes(one)
    again = from_bytes(content)
    assert (again.start, again.stop) == (1, 6)
    assert to_bytes(again) == content
    assert again.block.observers == ("SHGO", "FHGO")
    for name in ("status", "reason", "error", "method", "evaluations"):
        assert getattr(again.block, name).tolist() == getattr(one.block, name).tolist()
    assert again.followed is not None
    assert again.followed.member.tolist() == [2, 4]
    assert again.followed.x.shape == (2, 6, 2)


def test_the_recipe_makes_the_same_members_in_any_process() -> None:
    ours = small()
    theirs = ensemble_of(recipe_of(ours))
    assert theirs.base is not ours.base
    assert theirs.values(0, 12)["observers.*.theta"].tolist() == ours.values(0, 12)["observers.*.theta"].tolist()
    assert theirs.base.resolved() == ours.base.resolved()
    assert ensemble_of(recipe_of(ours)) is theirs  # nothing is compiled twice


def test_what_is_missing_is_known_by_the_files_alone(tmp_path: Path) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    assert found.missing() == [(0, 12)]
    for start, stop in ((3, 5), (4, 8), (10, 11)):  # others may have cut them otherwise
        found.write(carried(start, stop))
    assert found.missing() == [(0, 3), (8, 10), (11, 12)]
    assert found.missing(4, 9) == [(8, 9)]
    assert found.missing(5, 7) == []
    numbers = [one.start + i for one, which in found.blocks() for i in range(which.start, which.stop)]
    assert numbers == [3, 4, 5, 6, 7, 10]


def test_equal_members_are_equal_files(tmp_path: Path) -> None:
    stores = [Store.opened(tmp_path / name, small()) for name in ("a", "b")]
    for one in stores:
        one.write(carried(0, 3))
        one.write(carried(0, 3))
    names = [[s.path.name for s in one.stored()] for one in stores]
    assert names[0] == names[1]
    assert len(names[0]) == 1


def test_a_damaged_block_is_removed_and_said(tmp_path: Path) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    found.write(carried(0, 3))
    (one,) = found.stored()
    content = bytearray(one.path.read_bytes())
    content[len(content) // 2] ^= 1
    one.path.write_bytes(bytes(content))
    with pytest.raises(Damaged, match="damaged, and removed"):
        found.read(one)
    assert found.missing() == [(0, 12)]


def test_another_configuration_is_refused_with_the_difference(tmp_path: Path) -> None:
    folder = tmp_path / "a.sweep"
    Store.opened(folder, small()).write(carried(0, 3))
    assert Store.opened(folder, small()).missing() == [(3, 12)]
    other = ensemble(
        {"observers.*.theta": {"log": [2, 20, 4]}, "seed": {"count": 3}},
        base().varied({"observers.FHGO.delta": 4}),
        keep={"metrics": ["rmse", "peak"]},
    )
    with pytest.raises(Changed, match=r"observers.FHGO.delta: 3.0 -> 4.0; --fresh starts anew") as caught:
        Store.opened(folder, other)
    assert caught.value.exit_code == 2
    with pytest.raises(Changed, match=r"keep.trajectories: \"none\" -> \"all\""):
        Store.opened(folder, small(trajectories="all"))
    assert Store.opened(folder, other, fresh=True).missing() == [(0, 12)]


def test_another_version_or_other_code_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "a.sweep"
    Store.opened(folder, small())
    with monkeypatch.context() as patch:
        patch.setattr(fingerprint, "__version__", "9.9.9")
        with pytest.raises(Changed, match=r"hgorun .* -> 9\.9\.9"):
            Store.opened(folder, small())
    own = dict(fingerprint.own_code())
    monkeypatch.setattr(fingerprint, "own_code", lambda: own | {"engine": "0", "noise": "0"})
    with pytest.raises(Changed, match="the code of engine and noise changed"):
        Store.opened(folder, small())


def test_a_metric_that_is_not_kept_is_no_part_of_an_ensemble(tmp_path: Path) -> None:
    kept, everything = small(), ensemble({"seed": [1, 2]})
    before = fingerprint.ingredients(everything)
    Store.opened(tmp_path / "kept.sweep", kept)
    with METRICS.replaced("mine", Metric(name="mine", meaning="mine", unit="1", measure=lambda e: e.size[-1])):
        Store.opened(tmp_path / "kept.sweep", kept)
        now = fingerprint.ingredients(everything)
    assert fingerprint.difference(before, now) == "the code of module test_sweep_store was not there"
    assert fingerprint.difference(now, before) == "the code of module test_sweep_store is gone"


def test_beginning_anew_removes_what_is_ours_and_nothing_else(tmp_path: Path) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    found.write(carried(0, 3))
    (found.folder / "notes.txt").touch()
    (found.folder / "blocks" / "other.h5").touch()
    store.remove(found.folder)
    left = sorted(str(p.relative_to(found.folder)) for p in found.folder.rglob("*") if p.is_file())
    assert left == [os.path.join("blocks", "other.h5"), "notes.txt"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "x", "recipe": "", "made_of": {}, "members": 1}'])
def test_a_manifest_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(ConfigError, match="not the manifest of a sweep"):
        Store.existing(tmp_path)
    with pytest.raises(ConfigError, match="no folder of a sweep"):
        Store.existing(tmp_path / "nowhere")


def test_a_full_disk_leaves_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    found.write(carried(0, 3))

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(HgorunError, match="cannot be written: No space left on device"):
            found.write(carried(3, 6))
    assert [p.suffix for p in (found.folder / "blocks").iterdir()] == [".h5"]
    assert found.missing() == [(3, 12)]


def test_the_manifest_says_what_numbers_follow_from(tmp_path: Path) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    said = json.loads((found.folder / "manifest.json").read_text())
    assert said == found.manifest
    assert said["made_of"]["configuration"]["observers"]["SHGO"]["theta"] == 3
    assert {"engine", "simulation", "ensemble"} <= said["made_of"]["code"].keys()
    assert Store.existing(found.folder).ensemble.size == 12
    assert np.array_equal(Store.existing(found.folder).ensemble.values(0, 2)["seed"], [0, 1])
