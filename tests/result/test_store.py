"""Result files: layout, reading back, wholeness."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
import yaml

import hgorun

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
        assert f["observers/wild"].attrs["status"].startswith("diverged at t=")
        assert f["observers/wild"].attrs["diverged_at"] > 0
        assert np.all(np.isinf(f["metrics/wild/rmse"][()]))
        lost = f["time"][()] > f["observers/wild"].attrs["diverged_at"]
        assert np.all(np.isnan(f["observers/wild/xhat"][()][lost]))
        assert np.all(np.isfinite(f["observers/SHGO/xhat"][()]))


def test_no_time_stamps_inside(file: Path, config: Path) -> None:
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
        assert observer.status == back.observers[label].status
    np.testing.assert_equal(back.metrics(), result.metrics())


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
    with pytest.raises(hgorun.ConfigError, match="4 GiB"):
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
    "small type": (replaced("plant/x", shape=(2**30, 2), dtype="i1", chunks=(2**20, 2), compression="gzip"), "4 GiB"),
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
    "gains": (attribute("gains", "[", "observers/SHGO"), "attribute gains is not JSON"),
    "window": (attribute("windows", '{"steady": 3}'), "windows: steady is 3"),
    "window NaN": (attribute("windows", '{"steady": [0, NaN]}'), "windows: steady"),
    "average": (attribute("windows", '{"average": "a"}'), "windows: average is 'a'"),
    "windows": (attribute("windows", "[]"), "attribute windows must be a JSON object"),
    "unit": (attribute("units", '{"time": 3}'), "units: time is 3"),
    "error": (attribute("integration_error", '{"plant": "q"}'), "integration_error: plant is 'q'"),
    "large error": (attribute("integration_error", json.dumps({"plant": 10**400})), "integration_error: plant"),
    "labels twice": (attribute("labels", ["x1", "x1"], "plant/x"), "labels has a name twice"),
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
