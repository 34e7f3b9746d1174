"""The folder of an ensemble: blocks that never change, and nothing that is not noticed."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ensembles import base, ensemble, small
from examples import VAN_DER_POL, experiment

import hgorun
from hgorun.ensemble.blocks.carried import Carried, carry_out
from hgorun.ensemble.folder import store
from hgorun.ensemble.folder.block_file import Form, from_bytes, to_bytes
from hgorun.ensemble.folder.store import Changed, Store
from hgorun.ensemble.folder.stored import Damaged
from hgorun.ensemble.members import fingerprint
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.recipe import ensemble_of, recipe_of
from hgorun.errors import ConfigError, HgorunError
from hgorun.result.metrics.base import METRICS, Metric


def carried(start: int, stop: int) -> Carried:
    return carry_out(recipe_of(small()), start, stop)


def test_a_block_is_read_as_it_was_written() -> None:
    of = small(trajectories={"every": 2})
    one = carry_out(recipe_of(of), 1, 6)
    content = to_bytes(one, "f" * 64)
    again = from_bytes(content, Form.of(of, Path("a.h5"), "f" * 64, 1, 6))
    assert (again.start, again.stop) == (1, 6)
    assert to_bytes(again, "f" * 64) == content
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


def test_a_damaged_block_is_said_and_left_by_who_reads_it(tmp_path: Path) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    found.write(carried(0, 3))
    (one,) = found.stored()
    content = bytearray(one.path.read_bytes())
    content[len(content) // 2] ^= 1
    one.path.write_bytes(bytes(content))
    with pytest.raises(Damaged, match="the block is damaged; run the sweep again") as caught:
        found.read(one)
    assert (caught.value.path, caught.value.exit_code) == (one.path, 2)
    with pytest.raises(Damaged):
        hgorun.read_sweep(found.folder)
    with pytest.raises(Damaged):
        Store.opened(tmp_path / "b.sweep", small()).adopt(found)
    assert one.path.exists()


def test_what_is_merged_takes_the_place_of_own_damaged_blocks(tmp_path: Path) -> None:
    ours, theirs = (Store.opened(tmp_path / name, small()) for name in ("a.sweep", "b.sweep"))
    for one in (ours, theirs):
        one.write(carried(0, 3))
    ours.stored()[0].path.write_bytes(b"damaged")
    ours.adopt(theirs)
    assert ours.stored()[0].path.read_bytes() == theirs.stored()[0].path.read_bytes()


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


def test_a_change_far_inside_a_long_text_is_seen_and_shown(tmp_path: Path) -> None:
    def of(damping: str) -> Ensemble:
        long = " + ".join(f"0*sin({0.1 * k + 0.1:.1f}*t)" for k in range(20))
        dynamics = {"x1": "x2", "x2": f"-x1 + {long} - {damping}*x2"}
        plant = {"states": ["x1", "x2"], "dynamics": dynamics, "output": "x1", "initial": {"x1": 1, "x2": 0}}
        return ensemble({"observers.S.theta": [3, 4]}, experiment(plant, {"S": {"type": "shgo", "theta": 3}}))

    Store.opened(tmp_path, of("0.1"))
    with pytest.raises(Changed, match=r"dynamics.x2: \.\.\..*0\.1\*x2.* -> \.\.\..*7\.0\*x2"):
        Store.opened(tmp_path, of("7.0"))


def test_the_order_of_axes_and_observers_belongs_to_what_members_are(tmp_path: Path) -> None:
    axes = {"observers.*.theta": [2, 3], "seed": {"count": 3}}
    Store.opened(tmp_path / "a", ensemble(axes))
    with pytest.raises(Changed, match=r"axes: the order observers\.\*\.theta, seed -> seed, observers\.\*\.theta"):
        Store.opened(tmp_path / "a", ensemble(dict(reversed(axes.items()))))
    both = {"S": {"type": "shgo", "theta": 3}, "F": {"type": "fhgo1", "theta": 2, "delta": 3}}
    ours, theirs = (
        ensemble({"seed": {"count": 2}}, experiment(VAN_DER_POL, observers))
        for observers in (both, dict(reversed(both.items())))
    )
    Store.opened(tmp_path / "b", ours)
    with pytest.raises(Changed, match="observers: the order S, F -> F, S"):
        Store.opened(tmp_path / "b", theirs)


def test_blocks_of_something_else_are_never_taken(tmp_path: Path) -> None:
    folder = tmp_path / "a.sweep"
    other = ensemble(
        {"observers.*.theta": {"log": [2, 20, 4]}, "seed": {"count": 3}},
        base().varied({"observers.FHGO.delta": 4}),
        keep={"metrics": ["rmse", "peak"]},
    )
    old = Store.opened(folder, other)
    old.write(carry_out(recipe_of(other), 0, 12))
    (folder / "manifest.json").unlink()  # as --fresh does before it is killed
    ours = Store.opened(folder, small())
    assert ours.missing() == [(0, 12)]
    with pytest.raises(Changed, match="another command has begun it anew"):
        old.write(carry_out(recipe_of(other), 0, 3))
    (block,) = old.stored()
    renamed = block.path.with_name(
        block.path.name.replace(old.manifest.fingerprint[:16], ours.manifest.fingerprint[:16])
    )
    block.path.rename(renamed)
    with pytest.raises(ConfigError, match=f"{renamed.name}: .*it has the fingerprint of another one"):
        ours.read(*ours.stored())


def test_blocks_are_removed_before_the_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = Store.opened(tmp_path / "a.sweep", small())
    found.write(carried(0, 3))
    removed: list[str] = []
    unlink = Path.unlink

    def watched(path: Path, missing_ok: bool = False) -> None:
        removed.append(path.suffix)
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", watched)
    store.remove(found.folder)
    assert removed == [".h5", ".json", ".json"]


def test_what_cannot_be_removed_is_named(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").mkdir()
    with pytest.raises(ConfigError, match=r"manifest\.json: cannot be removed: Is a directory"):
        Store.opened(tmp_path, small(), fresh=True)


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


@pytest.mark.parametrize("text", ["", "[]", "{}", "[" * 100_000, '{"format": "hgorun-sweep-store-2"}'])
def test_a_manifest_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    words = r"manifest\.json: not the manifest of a sweep"
    with pytest.raises(ConfigError, match=words):
        Store.existing(tmp_path)
    with pytest.raises(Changed, match=f"{words}.*; --fresh starts anew"):
        Store.opened(tmp_path, small())
    with pytest.raises(ConfigError, match="there is no such folder"):
        Store.existing(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigError, match=r"not the folder of a sweep: manifest\.json is missing"):
        Store.existing(tmp_path / "empty")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"members": 5}, "5 members, but its axes give 12"),
        ({"members": -5}, "-5 members, but its axes give 12"),
        ({"members": True}, "members is missing or of another type"),
        ({"fingerprint": None}, "fingerprint is missing"),
        ({"fingerprint": "0" * 64}, "its fingerprint is not that of what it says"),
        ({"made_of": {}}, "made_of must have version, code"),
        ({"made_of": {"version": "0", "code": 3, "configuration": {}, "sweep": {}}}, "made_of must have version, code"),
        ({"recipe": "{}"}, "recipe: its recipe does not make an ensemble"),
        ({"recipe": "nonsense"}, "recipe: its recipe does not make an ensemble"),
    ],
)
def test_a_manifest_is_not_believed(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    folder = tmp_path / "a.sweep"
    Store.opened(folder, small())
    said = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(said | changes))
    with pytest.raises(ConfigError, match=words) as caught:
        Store.existing(folder)
    assert "manifest.json" in str(caught.value)
    if "recipe" in changes:  # we know it ourselves
        assert Store.opened(folder, small()).ensemble.size == 12
    else:
        with pytest.raises(Changed, match=f"{words}.*; --fresh starts anew"):
            Store.opened(folder, small())


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
    assert said == {"format": "hgorun-sweep-store-2", **asdict(found.manifest)}
    assert said["made_of"]["configuration"]["observers"]["SHGO"]["theta"] == 3
    assert {"engine", "simulation", "ensemble"} <= said["made_of"]["code"].keys()
    assert Store.existing(found.folder).ensemble.size == 12
    assert np.array_equal(Store.existing(found.folder).ensemble.values(0, 2)["seed"], [0, 1])
