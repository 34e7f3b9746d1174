"""Blocks that have the right name, and hold what nobody has written: each is refused by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np
import pytest
from ensembles import small

import hgorun
from hgorun.ensemble.blocks.carried import carry_out
from hgorun.ensemble.folder.block_file import to_bytes
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.recipe import recipe_of
from hgorun.errors import ConfigError


def _huge(file: h5py.File) -> None:
    del file["metrics/rmse"]
    file.create_dataset("metrics/rmse", shape=(10**6, 10**4), dtype="f8", chunks=(1000, 1000))


def _shape(file: h5py.File) -> None:
    del file["metrics/rmse"]
    file["metrics/rmse"] = [1.0]


def _link(file: h5py.File) -> None:
    del file["metrics/rmse"]
    file["metrics/rmse"] = h5py.ExternalLink("/etc/passwd", "x")


def _sparse(file: h5py.File) -> None:
    del file["reason/text"]
    file.create_dataset("reason/text", shape=(10**9,), dtype=h5py.string_dtype(), chunks=(1000,))


def _all(name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[name][...] = value

    return change


def _attribute(name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file.attrs[name] = value

    return change


@cache
def _content(fingerprint: str) -> bytes:
    return to_bytes(carry_out(recipe_of(small(trajectories="all")), 0, 4), fingerprint)


def _changed(fingerprint: str, change: Callable[[h5py.File], None]) -> bytes:
    buffer = BytesIO(_content(fingerprint))
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


def _put(store: Store, content: bytes, members: str = "0000000000-0000000004") -> str:
    """A block as anybody can write it, and its name."""
    name = f"{members}-{store.manifest.fingerprint[:16]}-{sha256(content).hexdigest()[:32]}.h5"
    (store.folder / "blocks").mkdir(exist_ok=True)
    (store.folder / "blocks" / name).write_bytes(content)
    return name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_huge, "metrics/rmse has type float64 and shape"),
        (_shape, "metrics/rmse has type float64 and shape"),
        (_link, "rmse is a link, which is refused"),
        (_sparse, "claims more numbers than its bytes can hold"),
        (_all("error/place", 99), "error/place must be places"),
        (_all("error/place", -1), "error/place must be places"),
        (_all("status", 99), "status holds numbers"),
        (_all("plant_status", -1), "plant_status holds numbers"),
        (_all("method/text", b"magic"), "method holds texts"),
        (_all("observers/text", b"other"), "observers are not those of the sweep"),
        (_all("followed/member", 7), "not the members that are followed"),
        (_all("followed/time", np.nan), "must be finite and strictly increasing"),
        (_attribute("stop", 10**9), "does not say the members"),
        (_attribute("fingerprint", "x"), "fingerprint of another one"),
    ],
)
@pytest.mark.measured
def test_a_wrong_block_is_refused_by_name(tmp_path: Path, change: Callable[[h5py.File], None], words: str) -> None:
    store = Store.opened(tmp_path / "a.sweep", small(trajectories="all"))
    name = _put(store, _changed(store.manifest.fingerprint, change))
    for reads in (lambda: list(store.blocks()), lambda: hgorun.read_sweep(store.folder)):
        with pytest.raises(ConfigError, match=f"{name}: .*{words}"):
            reads()


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89HDF\r\n\x1a\n" + b"\xff" * 3000])
def test_what_is_no_block_at_all_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    store = Store.opened(tmp_path / "a.sweep", small())
    name = _put(store, content)
    with pytest.raises(ConfigError, match=f"{name}: not a"):
        list(store.blocks())


def test_members_that_there_are_not_are_refused_by_name(tmp_path: Path) -> None:
    store = Store.opened(tmp_path / "a.sweep", small())
    for members in ("0000000000-9999999999", "0000000003-0000000003", "0000000008-0000000013"):
        name = _put(store, b"", members)
        with pytest.raises(ConfigError, match=f"{name}: not a block of this sweep, which has 12 members"):
            store.missing()
        (store.folder / "blocks" / name).unlink()


def test_a_folder_in_the_place_of_a_block_is_refused_by_name(tmp_path: Path) -> None:
    store = Store.opened(tmp_path / "a.sweep", small())
    path = store.folder / "blocks" / _put(store, b"")
    path.unlink()
    path.mkdir()
    with pytest.raises(ConfigError, match=f"{path.name}: the block cannot be read: Is a directory"):
        list(store.blocks())


@pytest.mark.costly
def test_many_blocks_are_read_in_order(tmp_path: Path) -> None:
    of = small()
    store = Store.opened(tmp_path / "a.sweep", of)
    for k in range(12):
        store.write(carry_out(recipe_of(of), k, k + 1))
    assert [one.start for one, _ in store.blocks()] == list(range(12))
