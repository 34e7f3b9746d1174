"""Result files: layout, reading back, wholeness."""

from __future__ import annotations

import fcntl
import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
import yaml

import hgorun
from hgorun.errors import ConfigError
from hgorun.result.hdf5.guarded import Failed, guarded
from hgorun.result.records.status import Verdict

CONFIG = """
title: small
time: {end: 2, output_step: 0.1, unit: h}
plant:
  type: contois
  inputs: {D: mu*(1 - abs(sin(t))/2)}
  initial: {x1: 1.5, x2: 15}
measurement:
  sampling: {period: 0.25}
  noise: [{type: uniform, low: -0.1, high: 0.1}]
observers:
  SHGO: {type: shgo, theta: 1, initial: {x1: 1, x2: 14}}
  FHGO r=2: {type: fhgo2, r: 2, theta: 2, initial: {x1: 1, x2: 14}}
  wild: {type: shgo, theta: 200, initial: {x1: 1, x2: 14}}
solver: {step: 0.01}
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "small.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def file(config: Path) -> Path:
    return hgorun.simulate(hgorun.load(config)).save(config.with_suffix(".h5"))


@pytest.mark.costly
def test_layout(file: Path, config: Path) -> None:
    with h5py.File(file) as f:
        attributes = dict(f.attrs)
        assert attributes["format"] == "hgorun-result-1"
        assert attributes["config"] == CONFIG
        digest = hashlib.sha256(attributes["config_resolved"].encode()).hexdigest()
        assert attributes["config_sha256"] == digest
        for key in ("seed", "hgorun_version", "python_version", "numpy_version", "casadi_version",
                    "llvmlite_version", "platform", "created", "status", "title"):  # fmt: skip
            assert key in attributes
        assert f["time"].shape == (21,)
        assert f["time"].attrs["units"] == "h"
        assert f["plant/x"].shape == (21, 2)
        assert list(f["plant/x"].attrs["labels"]) == ["x1", "x2"]
        assert list(f["plant/u"].attrs["labels"]) == ["D"]
        assert f["measurement/time"].shape == (9,)
        assert f["measurement/y"].shape == f["measurement/taken"].shape == (9, 1)
        group = f["observers/FHGO r=2"]
        assert set(group) == {"xhat", "state"}
        assert set(group["state"]) == {"eta", "alpha"}
        assert group["state/eta"].shape == (21, 2)
        assert group.attrs["type"] == "fhgo2"
        assert json.loads(group.attrs["gains"])["K_n"] == [4.0, 1.0]
        assert group.attrs["dimension"] == 4
        assert f["metrics/SHGO/rmse"].shape == (2,)
        assert f["observers/wild"].attrs["status"] == "diverged"
        assert f["observers/wild"].attrs["status_at"] == f["observers/wild"].attrs["diverged_at"]
        assert f["observers/wild"].attrs["diverged_at"] > 0
        assert np.all(np.isinf(f["metrics/wild/rmse"][()]))
        lost = f["time"][()] > f["observers/wild"].attrs["diverged_at"]
        assert np.all(np.isnan(f["observers/wild/xhat"][()][lost]))
        assert np.all(np.isfinite(f["observers/SHGO/xhat"][()]))


def test_no_time_stamps_inside(file: Path, config: Path) -> None:
    time.sleep(1.1)  # HDF5 counts seconds
    again = hgorun.simulate(hgorun.load(config)).save(config.with_name("again.h5"))
    one, two = bytearray(file.read_bytes()), bytearray(again.read_bytes())
    assert len(one) == len(two)
    with h5py.File(file) as f, h5py.File(again) as g:
        a, b = f.attrs["created"].encode(), g.attrs["created"].encode()
    assert bytes(one).replace(a, b"") == bytes(two).replace(b, b"")


@pytest.mark.parametrize("engine", ["h5netcdf"])
def test_xarray_opens_it_with_units_and_labels(file: Path, engine: str) -> None:
    with xarray.open_datatree(file, engine=engine) as tree:
        x = tree["plant"]["x"]
        assert x.dims == ("time", "plant_state")
        assert x.attrs["units"] == "g/L"
        assert tree["plant_state"].to_numpy().tolist() == ["x1", "x2"]
        assert float(x.sel(plant_state="x2")[0]) == 15.0
        assert tree["observers/SHGO"]["xhat"].dims == ("time", "plant_state")
    with xarray.open_dataset(file, engine=engine, group="observers/SHGO") as data:
        assert data["xhat"].shape == (21, 2)


def test_read_gives_back_what_was_saved(file: Path, config: Path) -> None:
    result, back = hgorun.simulate(hgorun.load(config)), hgorun.read(file)
    np.testing.assert_array_equal(result.x, back.x)
    np.testing.assert_array_equal(result.measurements.y, back.measurements.y)
    for label, observer in result.observers.items():
        np.testing.assert_array_equal(observer.xhat, back.observers[label].xhat)
        np.testing.assert_array_equal(observer.internal["alpha"], back.observers[label].internal["alpha"])
        assert observer.verdict == back.observers[label].verdict
    np.testing.assert_equal(back.metrics(), result.metrics())


@pytest.mark.measured("verdict0")
@pytest.mark.costly
@pytest.mark.parametrize(
    "verdict",
    [Verdict("inaccurate", None, "error 3e-2"), Verdict("undefined", 0.5, "sqrt of a negative number"), Verdict()],
)
def test_verdicts_are_stored_as_word_time_and_reason(file: Path, tmp_path: Path, verdict: Verdict) -> None:
    result = hgorun.read(file)
    observers = {**result.observers, "SHGO": replace(result.observers["SHGO"], verdict=verdict)}
    path = replace(result, verdict=verdict, observers=observers).save(tmp_path / "said.h5")
    back = hgorun.read(path)
    assert back.observers["SHGO"].verdict == back.verdict == verdict
    assert back.status == "undefined" if verdict.status == "undefined" else "diverged"
    with h5py.File(path) as f:
        attributes = f["observers/SHGO"].attrs
        assert attributes["status"] == verdict.status
        assert attributes.get("status_at") == verdict.at
        assert attributes.get("reason") == verdict.reason
        assert "diverged_at" not in attributes


def test_files_of_older_versions_say_the_time_in_the_status(file: Path, tmp_path: Path) -> None:
    old = tmp_path / "old.h5"
    old.write_bytes(file.read_bytes())
    with h5py.File(old, "r+") as f:
        del f.attrs["sha256"]
        attributes = f["observers/wild"].attrs
        del attributes["status_at"], attributes["reason"]
        at = attributes["diverged_at"]
        attributes["status"] = f"diverged at t={at:.6g}"
    back = hgorun.read(old)
    assert back.observers["wild"].verdict == Verdict("diverged", at)
    assert back.status == "diverged"


@pytest.mark.costly
def test_resolved_configuration_gives_the_same_run(file: Path, tmp_path: Path) -> None:
    back = hgorun.read(file)
    path = tmp_path / "small.yaml"
    path.write_text(back.config_resolved)
    again = hgorun.simulate(hgorun.load(path))
    np.testing.assert_array_equal(back.x, again.x)
    for label, observer in back.observers.items():
        np.testing.assert_array_equal(observer.xhat, again.observers[label].xhat)
    assert yaml.safe_load(again.config_resolved) == yaml.safe_load(back.config_resolved)


def test_to_xarray(config: Path) -> None:
    data = hgorun.simulate(hgorun.load(config)).to_xarray()
    assert data["xhat"].sel(observer="SHGO", state="x1").shape == (21,)


def test_a_file_with_absurd_sizes_is_refused(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "huge.h5"
    path.write_bytes(file.read_bytes())
    with h5py.File(path, "a") as f:
        del f["plant/x"]
        data = f["plant"].create_dataset("x", shape=(2**40, 2), chunks=(1024, 2), dtype=float)
        data.attrs["labels"] = ["x1", "x2"]
    with pytest.raises(hgorun.ConfigError, match="1 GiB"):
        hgorun.read(path)


def damaged(file: Path, path: Path, change: Callable[[h5py.File], object]) -> Path:
    path.write_bytes(file.read_bytes())
    with h5py.File(path, "a") as f:
        change(f)
    return path


def replaced(name: str, **new: Any) -> Callable[[h5py.File], object]:
    """Another data set in place of one, with its attribute labels."""

    def change(f: h5py.File) -> None:
        labels = f[name].attrs.get("labels")
        del f[name]
        data = f.create_dataset(name, **new)
        if labels is not None:
            data.attrs["labels"] = labels

    return change


def attribute(name: str, value: Any, place: str = "/") -> Callable[[h5py.File], object]:
    return lambda f: f[place].attrs.__setitem__(name, value)


NOT_A_RESULT: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "small type": (replaced("plant/x", shape=(2**30, 2), dtype="i1", chunks=(2**20, 2), compression="gzip"), "1 GiB"),
    "text": (replaced("plant/x", data=[["a", "b"]]), "plant/x holds object"),
    "vlen": (replaced("plant/x", shape=(21, 2), dtype=h5py.vlen_dtype(float)), "plant/x holds object"),
    "compound": (replaced("plant/x", shape=(21, 2), dtype=[("a", float)]), "plant/x holds"),
    "complex": (replaced("plant/x", shape=(21, 2), dtype=complex), "plant/x holds complex"),
    "empty": (replaced("plant/x", data=h5py.Empty(float)), "plant/x"),
    "group": (lambda f: (f.__delitem__("time"), f.create_group("time")), "time is not an ordinary data set"),
    "no group": (replaced("observers/SHGO/state", data=1.0), "observers/SHGO/state is not a group"),
    "missing": (lambda f: f.__delitem__("metrics/SHGO"), "metrics/SHGO is missing"),
    "internal state": (replaced("observers/SHGO/state/alpha", data=[1.0]), "state/alpha has shape"),
    "time NaN": (replaced("time", data=np.full(21, np.nan)), "time must be"),
    "time constant": (replaced("time", data=np.ones(21)), "time must be"),
    "time backwards": (replaced("time", data=-np.arange(21.0)), "time must be"),
    "time in two dimensions": (replaced("time", data=np.arange(21.0)[:, None]), "time has shape"),
    "no time": (replaced("time", data=np.zeros(0)), "time is empty"),
    "seed": (attribute("seed", np.inf), "attribute seed"),
    "seed text": (attribute("seed", "1"), "attribute seed"),
    "title": (attribute("title", 3), "attribute title"),
    "dimension": (attribute("dimension", 1.5, "observers/SHGO"), "attribute dimension"),
    "diverged_at": (attribute("diverged_at", "late", "observers/SHGO"), "attribute diverged_at"),
    "status": (attribute("status", "fine", "observers/SHGO"), "attribute status must be one of ok, inaccurate"),
    "status_at": (attribute("status_at", "late", "observers/SHGO"), "attribute status_at must be a number"),
    "reason": (attribute("reason", 3, "observers/SHGO"), "attribute reason must be text"),
    "gains": (attribute("gains", "[", "observers/SHGO"), "attribute gains is not JSON"),
    "window": (attribute("windows", '{"steady": 3}'), "windows: steady is 3"),
    "window NaN": (attribute("windows", '{"steady": [0, NaN]}'), "windows: steady"),
    "average": (attribute("windows", '{"average": "a"}'), "windows: average is 'a'"),
    "windows": (attribute("windows", "[]"), "attribute windows must be a JSON object"),
    "unit": (attribute("units", '{"time": 3}'), "units: time is 3"),
    "error": (attribute("integration_error", '{"plant": "q"}'), "integration_error: plant is 'q'"),
    "large error": (attribute("integration_error", json.dumps({"plant": 10**400})), "integration_error: plant"),
    "labels twice": (attribute("labels", ["x1", "x1"], "plant/x"), "labels has a duplicate name"),
    "one label": (attribute("labels", "x1", "plant/x"), "labels must be a list"),
}


@pytest.mark.parametrize("name", NOT_A_RESULT)
def test_a_wrong_content_is_refused(name: str, file: Path, tmp_path: Path) -> None:
    change, message = NOT_A_RESULT[name]
    with pytest.raises(hgorun.ConfigError, match=message) as caught:
        hgorun.read(damaged(file, tmp_path / "wrong.h5", change))
    assert "wrong.h5" in str(caught.value)


@pytest.mark.parametrize("name", ["time", "plant", "plant/u", "plant/x", "observers", "observers/SHGO", "metrics/SHGO"])
@pytest.mark.parametrize("kind", ["soft", "file", "pipe"])
def test_links_are_refused(name: str, kind: str, file: Path, tmp_path: Path) -> None:
    """Also to a pipe, which would wait for its writer forever."""
    os.mkfifo(tmp_path / "pipe")
    link = {
        "soft": h5py.SoftLink(f"/elsewhere/{name}"),
        "file": h5py.ExternalLink(str(file), name),
        "pipe": h5py.ExternalLink(str(tmp_path / "pipe"), name),
    }[kind]

    def change(f: h5py.File) -> None:
        f.move(name, f"elsewhere/{name}")
        f[name] = link

    with pytest.raises(hgorun.ConfigError, match=f"{name.split('/')[-1]} is a link"):
        hgorun.read(damaged(file, tmp_path / "linked.h5", change))


@pytest.mark.parametrize("allowed", ["2G", None, math.nan, 0, -1, True])
def test_memory_is_a_positive_number(tmp_path: Path, allowed: Any) -> None:
    (tmp_path / "empty.h5").touch()
    with pytest.raises(ConfigError, match=r"^max_memory: expected a number of bytes greater than 0, found "):
        hgorun.read(tmp_path / "empty.h5", max_memory=allowed)
    with pytest.raises(ConfigError, match=r"^max_memory: expected a number of bytes greater than 0, found "):
        hgorun.read_sweep(tmp_path / "empty.h5", max_memory=allowed)


def test_memory_may_be_without_limit(file: Path) -> None:
    for allowed in (math.inf, 1e20, np.float64(2**40)):
        assert hgorun.read(file, max_memory=allowed).states == ("x1", "x2")


@pytest.mark.parametrize("name", ["", ".", 3])
def test_a_figure_has_a_name(file: Path, monkeypatch: pytest.MonkeyPatch, name: Any) -> None:
    result = hgorun.read(file)
    monkeypatch.setattr("hgorun.figures.drawing.comparison", None)  # said before anything is drawn
    with pytest.raises(ConfigError, match=r"^plot: expected the name of a file \.pdf, \.png or \.svg, found "):
        result.plot(name)
    with pytest.raises(ConfigError, match=r"^figures are not written as 'pgn'\. Did you mean `png`"):
        result.plot("a.pgn")


def test_a_pipe_is_no_file(config: Path, tmp_path: Path) -> None:
    for name in ("a.h5", "a.yaml"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(hgorun.ConfigError, match="not a regular file"):
        hgorun.read(tmp_path / "a.h5")
    with pytest.raises(hgorun.ConfigError, match="not a regular file"):
        hgorun.load(tmp_path / "a.yaml")
    (tmp_path / "b.yaml").write_text("extends: a.yaml\n")
    with pytest.raises(hgorun.ConfigError, match=r"b\.yaml:1: extends: .*not a regular file"):
        hgorun.load(tmp_path / "b.yaml")


def test_an_unwritable_place_is_said(config: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = hgorun.simulate(hgorun.load(config))
    with pytest.raises(hgorun.HgorunError, match="cannot be written"):
        result.save(tmp_path / "file" / "a.h5")


def test_a_file_of_another_kind_is_not_replaced_by_a_result(config: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    result = hgorun.simulate(hgorun.load(config))
    for name, instead in ((config.name, ""), ("a.CSV", "; to_pandas()"), ("a.png", "; plot(...)")):
        with pytest.raises(hgorun.ConfigError) as refused:
            result.save(tmp_path / name)
        right = f"save: expected the name of a file .h5, .hdf5, .nc, found {tmp_path / name}{instead}"
        assert str(refused.value).startswith(right)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    for name in ("a.h5", "a.hdf5", "a.NC", "run.2", "results.v2", "run"):
        assert hgorun.read(result.save(tmp_path / name)).name == result.name


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_a_killed_process_leaves_no_partial_file(tmp_path: Path) -> None:
    """Whatever the moment, the result is absent or whole; an earlier one stays until it is replaced."""
    script = (
        "import sys, hgorun\n"
        f"r = hgorun.simulate(hgorun.load({str(tmp_path / 'small.yaml')!r}))\n"
        "print('ready', flush=True)\n"
        f"while True: r.save({str(tmp_path / 'out' / 'small.h5')!r})\n"
    )
    (tmp_path / "small.yaml").write_text(CONFIG)
    delays = np.random.default_rng(1).uniform(0.0, 0.05, 8)
    for delay in delays:
        process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        if (tmp_path / "out" / "small.h5").exists():
            assert hgorun.read(tmp_path / "out" / "small.h5").time.size == 21


def test_the_resolved_configuration_is_what_the_numbers_follow_from(config: Path) -> None:
    plain = hgorun.load(config)
    config.write_text(
        config.read_text()
        + "reference: A book\nfigures: {first: {panels: [{state: x1}]}}\n"
        + "claims: [{id: a, claim: Small., value: \"rmse('SHGO', x1)\", below: 1}]\n"
    )
    assert hgorun.load(config, ["title=Another one"]).resolved_text == plain.resolved_text
    assert hgorun.load(config, ["seed=7"]).resolved_text != plain.resolved_text


def test_numbers_have_checksums_and_digests(file: Path) -> None:
    with h5py.File(file) as f:
        names: list[str] = []
        f.visititems(lambda name, thing: names.append(name) if isinstance(thing, h5py.Dataset) else None)
        assert all(len(f[name].attrs["sha256"]) == 64 for name in names)
        x = f["plant/x"]
        assert x.fletcher32
        assert x.attrs["sha256"] == hashlib.sha256(x[()].astype("<f8").tobytes()).hexdigest()


@pytest.mark.parametrize("name", ["time", "plant/x", "measurement/y", "observers/SHGO/xhat", "metrics/SHGO/rmse"])
@pytest.mark.parametrize("change", ["zeroed", "flipped"])
def test_damage_to_numbers_is_found(name: str, change: str, file: Path, tmp_path: Path) -> None:
    content = bytearray(file.read_bytes())
    with h5py.File(file) as f:
        place, size = f[name].id.get_chunk_info(0).byte_offset, f[name].id.get_chunk_info(0).size
    if change == "zeroed":
        content[place : place + size // 2] = bytes(size // 2)
    else:
        content[place + 3] ^= 1
    path = tmp_path / "damaged.h5"
    path.write_bytes(content)
    with pytest.raises(hgorun.ConfigError, match=rf"damaged\.h5: {name} is damaged"):
        hgorun.read(path)


@pytest.mark.parametrize("name", ["plant/x", "observers/SHGO/xhat"])
def test_numbers_written_anew_do_not_have_the_digest(name: str, file: Path, tmp_path: Path) -> None:
    """Another program's checksum is right, our digest is not."""

    def change(f: h5py.File) -> None:
        f[name][0, 0] += 1e-9

    with pytest.raises(hgorun.ConfigError, match=f"{name} is damaged: its numbers"):
        hgorun.read(damaged(file, tmp_path / "changed.h5", change))


@pytest.mark.costly
def test_attributes_that_changed_do_not_have_the_digest(file: Path, tmp_path: Path) -> None:
    for change in (attribute("status", "fine"), attribute("gains", "{}", "observers/SHGO")):
        with pytest.raises(hgorun.ConfigError, match="attributes are damaged"):
            hgorun.read(damaged(file, tmp_path / "changed.h5", change))


@pytest.mark.costly
def test_a_file_of_before_has_no_digests_and_opens(file: Path, tmp_path: Path) -> None:
    def without(f: h5py.File) -> None:
        del f.attrs["sha256"]
        f.visititems(lambda _, thing: thing.attrs.__delitem__("sha256") if "sha256" in thing.attrs else None)
        values, labels = f["plant/x"][()], f["plant/x"].attrs["labels"]
        del f["plant/x"]
        f.create_dataset("plant/x", data=values).attrs["labels"] = labels

    old = hgorun.read(damaged(file, tmp_path / "old.h5", without))
    np.testing.assert_array_equal(old.x, hgorun.read(file).x)


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.measured("5", "11", "15")
def test_any_damage_is_found_or_harmless(seed: int, file: Path, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    content = bytearray(file.read_bytes())
    length = int(random.choice([1, 8, 200, 2000]))
    place = int(random.integers(len(content) - length))
    content[place : place + length] = bytes(length) if seed % 2 else random.bytes(length)
    path = tmp_path / "damaged.h5"
    path.write_bytes(content)
    whole = hgorun.read(file)
    try:
        back = hgorun.read(path)
    except hgorun.ConfigError as error:
        assert "damaged.h5" in str(error)  # noqa: PT017  # either is right
        return
    for one, other in ((back.x, whole.x), (back.observers["SHGO"].xhat, whole.observers["SHGO"].xhat)):
        np.testing.assert_array_equal(one, other)


def test_a_file_that_hangs_or_crashes_its_reader_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert guarded(lambda: 3, seconds=10, memory=2**28) == 3
    started = time.monotonic()
    with pytest.raises(Failed, match="too long"):
        guarded(lambda: time.sleep(60), seconds=0.2, memory=2**28)
    assert time.monotonic() - started < 5
    with pytest.raises(Failed, match="crashes"):
        guarded(os.abort, seconds=10, memory=2**28)
    with pytest.raises(Failed, match="crashes"):
        guarded(lambda: np.ones(2**28).sum(), seconds=10, memory=2**28)


def test_a_file_of_another_program_is_said_to_be_open(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "open.h5"
    path.write_bytes(file.read_bytes())
    with path.open("rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)  # as HDF5 does
        with pytest.raises(hgorun.ConfigError, match="another program has it open"):
            hgorun.read(path)


def test_labels_of_a_stranger_do_not_steer_the_terminal(file: Path, tmp_path: Path) -> None:
    def change(f: h5py.File) -> None:
        f.move("observers/SHGO", "observers/\x1b[31m")

    with pytest.raises(hgorun.ConfigError, match="cannot be shown") as caught:
        hgorun.read(damaged(file, tmp_path / "escape.h5", change))
    assert str(caught.value).isprintable()


@pytest.mark.slow
def test_many_observers_fit_into_a_file(config: Path, tmp_path: Path) -> None:
    """In HDF5's oldest form 4,000 data sets of one dimension are too many."""
    small = hgorun.simulate(hgorun.load(config))
    observers = {f"S{i}": small.observers["SHGO"] for i in range(620)}
    file = replace(small, observers=observers).save(tmp_path / "many.h5")
    again = hgorun.read(file)
    assert len(again.observers) == 620
    assert np.array_equal(again.observers["S619"].xhat, small.observers["SHGO"].xhat)
