"""Ensembles carried out: the same file whoever does it, in whatever order, and however often it is interrupted."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from ensembles import base, ensemble, small
from examples import VAN_DER_POL, experiment

import hgorun
from hgorun.ensemble import collecting, executors
from hgorun.ensemble.blocks.carried import Carried, carry_out
from hgorun.ensemble.blocks.cuts import Cuts, most_members
from hgorun.ensemble.collected.reading import read
from hgorun.ensemble.collecting import collect, is_collected
from hgorun.ensemble.executors import Executor, processes, threads
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.recipe import recipe_of
from hgorun.ensemble.sweep import Count, Part, Place, finished, sweep_to
from hgorun.ensemble.sweep import carry_out as carry_out_all
from hgorun.errors import ConfigError, HgorunError, SimulationError
from hgorun.files import _MACHINE, _alive
from hgorun.result.hdf5 import digests, sink


def undisturbed(folder: Path, of: Ensemble) -> bytes:
    """The file of an ensemble that nothing has interrupted."""
    place = Place.of(folder / "undisturbed.h5")
    sweep_to(of, place)
    return place.file.read_bytes()


def by_blocks(order: list[tuple[int, int]]) -> Executor:
    """Blocks given beforehand, in some order."""

    def run(recipe: str, cuts: Cuts, told: object) -> Iterator[Carried]:
        for start, stop in order:
            yield carry_out(recipe, start, stop)

    return run


@pytest.mark.slow
def test_a_member_has_the_bits_that_it_has_alone(tmp_path: Path) -> None:
    of = small(trajectories="all")
    sweep_to(of, Place.of(tmp_path / "a.sweep.h5"))
    found = read(tmp_path / "a.sweep.h5")
    for i in (0, 7, 11):
        alone = hgorun.simulate(base().varied(of.members(i, i + 1).of_observers(base()).changes(0)))
        for j, label in enumerate(found.observers):
            assert found.metrics["rmse"][i, j].tolist() == alone.observers[label].metrics["rmse"].tolist()
            assert found.trajectories is not None
            assert np.array_equal(found.trajectories.xhat[i, j], alone.observers[label].xhat)


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["none", {"every": 5}, {"worst": 3, "by": "rmse", "observer": "SHGO", "state": "x2"}])
@pytest.mark.measured("kept1", "kept2")
def test_the_file_does_not_tell_how_it_came_about(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept: str | dict[str, Any]
) -> None:
    of = small(trajectories=kept)
    whole = undisturbed(tmp_path, of)
    monkeypatch.setattr(collecting, "_BATCH", 12)
    for i, order in enumerate([[(8, 12), (0, 1), (1, 8)], [(5, 9), (0, 6), (7, 12), (0, 12)]]):
        place = Place.of(tmp_path / f"{i}.h5")
        store = Store.opened(place.folder, of)
        carry_out_all(store, by_blocks(order))
        assert finished(store, place.file, lambda: None)
        assert place.file.read_bytes() == whole


@pytest.mark.slow
@pytest.mark.parametrize(
    ("measurement", "step", "axes"),
    [
        ({"sampling": {"period": 0.1}}, None, {"observers.SHGO.theta": {"log": [1, 300, 13]}, "seed": {"count": 2}}),
        ({"sampling": {"period": 0.1}}, 0.05, {"observers.*.theta": {"log": [1, 3000, 30]}}),
        ({"sampling": {"period": 0.1, "jitter": 0.02, "dropout": 0.1}}, 0.01, {"seed": {"count": 30}}),
        ({"delay": 0.1}, 0.01, {"measurement.delay": {"linear": [0.05, 0.3, 30]}}),
    ],
    ids=["automatic steps", "divergence", "random times", "delays"],
)
@pytest.mark.measured("delays")
def test_blocks_decide_nothing(
    tmp_path: Path, measurement: dict[str, Any], step: float | None, axes: dict[str, Any]
) -> None:
    """Nothing in the file, steps and statuses included, depends on who was carried out side by side with whom."""
    observers = {"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo1", "theta": 2, "delta": 3}}
    of = ensemble(axes, experiment(VAN_DER_POL, observers, end=1.0, step=step, measurement=measurement))
    files = set()
    bounds = [k for k in range(of.size) if k % 6 < 2]  # one member alone, then five
    orders = [[(0, of.size)], [(1, of.size), (0, 1)], list(pairwise([*bounds, of.size]))]
    for i, order in enumerate(orders):
        place = Place.of(tmp_path / f"{i}.h5")
        store = Store.opened(place.folder, of)
        carry_out_all(store, by_blocks(order))
        assert finished(store, place.file, lambda: None)
        files.add(place.file.read_bytes())
    assert len(files) == 1


@pytest.mark.measured
@pytest.mark.slow
def test_processes_give_the_same_file(tmp_path: Path) -> None:
    of = small(trajectories={"every": 5})
    store = Store.opened(tmp_path / "a.sweep", of)
    told: list[Count] = []
    carry_out_all(store, processes(2), workers=2, told=lambda count: told.append(Count(count.members, count.done)))
    assert (told[0], told[-1]) == (Count(12, 0), Count(12, 12))
    collect(store, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == undisturbed(tmp_path, of)


@pytest.mark.slow
def test_xarray_opens_the_file_with_the_axes_as_dimensions(tmp_path: Path) -> None:
    import xarray

    sweep_to(small(trajectories={"every": 5}), Place.of(tmp_path / "a.sweep.h5"))
    with xarray.open_dataset(tmp_path / "a.sweep.h5", engine="h5netcdf") as found:
        assert found["rmse"].dims == ("observers.*.theta", "seed", "observer", "state")
        assert found["seed"].values.tolist() == [0, 1, 2]
        assert found["status"].attrs["flag_meanings"] == "ok inaccurate diverged undefined failed"
        assert set(found["error"].values.ravel()) == {""}
        one = found["rmse"].sel({"observers.*.theta": 20, "seed": 1, "observer": "FHGO", "state": "x2"})
        assert np.isfinite(float(one))
        assert found.attrs["format"] == "hgorun-sweep-1"
    with xarray.open_dataset(tmp_path / "a.sweep.h5", engine="h5netcdf", group="trajectories") as kept:
        assert kept["xhat"].dims == ("member", "observer", "time", "state")
        assert kept["member"].values.tolist() == [0, 5, 10]
    with xarray.open_dataset(tmp_path / "a.sweep.h5", engine="netcdf4" if _has_netcdf4() else "h5netcdf") as other:
        assert other.sizes["seed"] == 3


def _has_netcdf4() -> bool:
    try:
        import netCDF4  # type: ignore[import-not-found]  # noqa: F401  # an independent reader, where there is one
    except ImportError:
        return False
    return True


@pytest.mark.costly
def test_zipped_members_have_their_axes_as_coordinates(tmp_path: Path) -> None:
    import xarray

    axes = {"observers.SHGO.theta": [2.0, 3.0, 4.0], "solver.method": ["rk4", "euler", "rk4"], "seed": [3, 1, 2]}
    sweep_to(ensemble(axes, combine="zip"), Place.of(tmp_path / "a.h5"))
    with xarray.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as found:
        assert found["rmse"].dims == ("member", "observer", "state")
        assert set(axes) <= set(found.coords)
        assert found["solver.method"].values.tolist() == ["rk4", "euler", "rk4"]
    again = read(tmp_path / "a.h5")
    assert {path: values.tolist() for path, values in again.axes.items()} == axes
    assert list(again.metrics) == list(ensemble(axes).metrics)


@pytest.mark.costly
def test_a_member_that_fails_is_recorded_and_stops_nobody(tmp_path: Path) -> None:
    of = ensemble({"observers.SHGO.theta": [2.0, -1.0, 3.0]}, keep={"trajectories": "all"})
    told: list[int] = []
    store = Store.opened(tmp_path / "a.sweep", of)
    carry_out_all(store, threads(1), told=lambda count: told.append(count.failed))
    collect(store, tmp_path / "a.h5")
    found = read(tmp_path / "a.h5")
    assert told[-1] == 1
    assert len(told) > 2  # inside of a block, too
    assert found.error.tolist() == ["", "observers.SHGO.theta: expected a number above 0, found -1.0", ""]
    assert found.status[:, 0].tolist() == [0, 4, 0]
    assert found.trajectories is not None
    assert np.isnan(found.trajectories.x[:, 0, 0]).tolist() == [False, True, False]


@pytest.mark.costly
def test_a_plant_that_diverges_fails_alone(tmp_path: Path) -> None:
    of = ensemble({"plant.parameters.mu": [1.0, -400.0], "seed": {"count": 2}})
    sweep_to(of, Place.of(tmp_path / "a.h5"))
    found = read(tmp_path / "a.h5")
    assert [text.startswith("plant: ") for text in found.error] == [False, False, True, True], found.error
    assert found.status[:, 0].tolist() == [0, 0, 4, 4]


def test_the_worst_members_are_followed(tmp_path: Path) -> None:
    of = small(trajectories={"worst": 2, "by": "peak"})
    sweep_to(of, Place.of(tmp_path / "a.h5"))
    found = read(tmp_path / "a.h5")
    largest = found.metrics["peak"].reshape(12, -1).max(axis=1)
    assert found.trajectories is not None
    assert found.trajectories.member.tolist() == np.argsort(-largest)[:2].tolist()


@pytest.mark.measured
@pytest.mark.slow
def test_damaged_blocks_are_made_anew(tmp_path: Path) -> None:
    of = small()
    whole = undisturbed(tmp_path, of)
    place = Place.of(tmp_path / "a.h5")
    store = Store.opened(place.folder, of)
    carry_out_all(store, by_blocks([(0, 6), (6, 12)]))
    store.stored()[1].path.write_bytes(b"nothing")
    assert finished(store, place.file, lambda: carry_out_all(store))
    assert place.file.read_bytes() == whole
    assert finished(store, place.file, lambda: pytest.fail("nothing is missing"))
    place.file.write_bytes(whole[:1000])
    assert not is_collected(store, place.file)


def _flipped(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(bytes(content))


def _zeros(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["rmse"][...] = 0


def _no_status(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["status"]


def _wrong_status(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["status"][...] = 99


@pytest.mark.slow
@pytest.mark.parametrize("damage", [_flipped, _zeros, _no_status, _wrong_status])
def test_a_damaged_collected_file_is_collected_again(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    place = Place.of(tmp_path / "a.h5")
    sweep_to(small(), place)
    whole = place.file.read_bytes()
    damage(place.file)
    sweep_to(small(), place)
    assert place.file.read_bytes() == whole


@pytest.mark.costly
def test_another_title_is_collected_without_carrying_anything_out(tmp_path: Path) -> None:
    place, of = Place.of(tmp_path / "a.h5"), small()
    blocks = [one.path.name for one in sweep_to(replace(of, title="before"), place).stored()]
    store = Store.opened(place.folder, replace(of, title="after"))
    assert [one.path.name for one in store.stored()] == blocks
    assert finished(store, place.file, lambda: pytest.fail("nothing is missing"))
    assert read(place.file).title == "after"


@pytest.mark.costly
def test_a_full_disk_leaves_no_half_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of = small()
    store = Store.opened(tmp_path / "a.sweep", of)
    carry_out_all(store)

    class Full(sink.Sink):
        def put(self, data: memoryview) -> int:
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(sink, "Sink", Full)
        with pytest.raises(HgorunError, match=r"a\.h5: cannot be written: No space left on device"):
            collect(store, tmp_path / "a.h5")
    assert not (tmp_path / "a.h5").exists()
    collect(store, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == undisturbed(tmp_path, of)


def test_nothing_is_collected_of_a_part(tmp_path: Path) -> None:
    store = Store.opened(tmp_path / "a.sweep", small())
    carry_out_all(store, part=Part(2, 3))
    assert store.missing() == [(0, 4), (8, 12)]
    with pytest.raises(HgorunError, match="8 of 12 members are missing, the first is 0"):
        collect(store, tmp_path / "a.h5")


def test_parts_are_all_members_once() -> None:
    for size, count in ((12, 5), (3, 8), (1, 1)):
        ranges = [Part(k, count).range(size) for k in range(1, count + 1)]
        assert [n for a, b in ranges for n in range(a, b)] == list(range(size))
    assert Part.read("2/8") == Part(2, 8)
    for text in ("0/2", "3/2", "2", "a/b", "1/0", "-1/2", "1/2/3"):
        with pytest.raises(ConfigError, match="--part: expected k/n with 1 <= k <= n"):
            Part.read(text)


@pytest.mark.slow
def test_parts_in_several_folders_are_merged(tmp_path: Path) -> None:
    of = small()
    whole = Store.opened(tmp_path / "whole.sweep", of)
    for k in (1, 2):
        one = Store.opened(tmp_path / f"{k}.sweep", of)
        carry_out_all(one, part=Part(k, 2))
        whole.adopt(one)
    collect(whole, tmp_path / "whole.h5")
    assert (tmp_path / "whole.h5").read_bytes() == undisturbed(tmp_path, of)


def test_blocks_take_seconds_and_little_memory() -> None:
    cuts = Cuts([(0, 100_000)])
    start, stop = next(cuts)
    one = carry_out(recipe_of(small()), 0, 2)

    def took(seconds: float, size: int) -> None:
        cuts.learn(Carried(start=0, stop=size, block=one.block, seconds=seconds))

    took(32.0, 32)
    assert next(cuts) == (stop, stop + 32)  # a second a member: no smaller than lanes are wide
    took(0.32, 32)
    start, stop = next(cuts)
    assert stop - start == 192  # two seconds at a hundredth of a second
    took(1e-6, 192)
    start, stop = next(cuts)
    assert stop - start == 4096
    assert list(Cuts([(3, 40), (50, 51)])) == [(3, 40), (50, 51)]
    assert all(b - a <= 50 for a, b in Cuts([(0, 1000)], most=50))
    assert most_members(small()) == 4096
    long = ensemble({"seed": [1]}, base().varied({"time.end": 5000}), keep={"trajectories": "all"})
    assert most_members(long) < 20


class _Dying:
    """A pool whose process is killed again and again."""

    def __init__(self, *_: object) -> None:
        self._processes: dict[int, Any] = {}

    def submit(self, *_: object) -> Any:
        raise BrokenProcessPool

    def shutdown(self, **_: object) -> None:
        """Nothing runs."""


def test_processes_that_always_die_are_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "_pool", _Dying)
    store = Store.opened(tmp_path / "a.sweep", small())
    with pytest.raises(SimulationError, match="worker processes are killed again and again"):
        carry_out_all(store, processes(2), workers=2)


@pytest.mark.unmeasured
@pytest.mark.slow
def test_what_a_killed_process_was_doing_is_done_again(tmp_path: Path) -> None:
    of = ensemble({"observers.*.theta": {"log": [2, 20, 8]}, "seed": {"count": 40}}, keep={"metrics": ["rmse"]})
    whole = undisturbed(tmp_path, of)
    store = Store.opened(tmp_path / "a.sweep", of)
    killed: list[int] = []

    def kill(count: Count) -> None:
        if count.done and not killed:
            import multiprocessing

            victim = multiprocessing.active_children()[0].pid
            assert victim is not None
            killed.append(victim)
            os.kill(victim, signal.SIGKILL)

    carry_out_all(store, processes(2), workers=2, told=kill)
    assert killed
    collect(store, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == whole


CONFIG = """
base:
  time: {end: 2, output_step: 0.1}
  plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}
  measurement: {sampling: {period: 0.1}, noise: [{type: gaussian, std: 0.1}]}
  observers:
    SHGO: {type: shgo, theta: 3}
    FHGO: {type: fhgo1, theta: 2, delta: 3}
  solver: {step: 1e-3}
axes:
  observers.SHGO.theta: {log: [2, 20, 10]}
  seed: {count: 32}
keep: {trajectories: {every: 50}}
"""


@pytest.mark.unmeasured
@pytest.mark.slow
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_kills_at_any_moment_leave_the_same_file(tmp_path: Path, executor: str) -> None:
    """HGORUN_KILLS says how many sweeps are killed, each at several moments."""
    (tmp_path / "s.yaml").write_text(CONFIG)
    moments = random.Random(executor)
    command = [sys.executable, "-m", "hgorun", "sweep", "s.yaml", "-q", "--executor", executor, "--jobs", "2"]

    def run(output: str, patience: float | None) -> int:
        process = subprocess.Popen([*command, "-o", output], cwd=tmp_path, stderr=subprocess.DEVNULL)
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.send_signal(moments.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM]))
        return process.wait()

    began = time.monotonic()
    assert run("undisturbed", None) == 0
    longest = time.monotonic() - began
    whole = (tmp_path / "undisturbed" / "s.sweep.h5").read_bytes()
    for i in range(int(os.environ.get("HGORUN_KILLS", "1"))):
        codes = [run(f"{i}", moments.uniform(0.3, 1.0) * longest) for _ in range(3)]
        codes.append(run(f"{i}", None))
        assert codes[-1] == 0, codes
        assert (tmp_path / f"{i}" / "s.sweep.h5").read_bytes() == whole
        left = [p.name for p in (tmp_path / f"{i}").rglob("*") if p.suffix == ".part"]
        assert left == []


@pytest.mark.costly
def test_what_a_killed_process_has_left_of_the_file_goes(tmp_path: Path) -> None:
    place = Place.of(tmp_path / "a.h5")
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    left = tmp_path / f".a.h5-{_MACHINE}-{process.pid}-x.part"
    left.touch()
    sweep_to(small(), place)
    assert place.file.is_file()
    assert not left.exists()


@pytest.mark.costly
def test_every_data_set_has_its_digest(tmp_path: Path) -> None:
    sweep_to(small(trajectories={"every": 5}), Place.of(tmp_path / "a.h5"))
    with h5py.File(tmp_path / "a.h5") as file:
        names: list[str] = []
        file.visit(names.append)
        assert [n for n in names if isinstance(file[n], h5py.Dataset) and "sha256" not in file[n].attrs] == []
        assert file["rmse"].attrs["sha256"] == digests.of_numbers(file["rmse"][()])
        assert file["error"].attrs["sha256"] == digests.of_names(file["error"].asstr()[()].ravel().tolist())
        assert file["observer"].attrs["sha256"] == digests.of_names(["SHGO", "FHGO"])


_BUSY = """
import multiprocessing, os, signal, sys, time
from concurrent.futures import ProcessPoolExecutor
from hgorun.process import serve

def work(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(60)

if __name__ == "__main__":
    pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=serve)
    pool.submit(work, sys.argv[1])
    time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("whom", ["the worker by SIGTERM", "its parent by SIGKILL"])
def test_a_busy_worker_ends_at_once(tmp_path: Path, whom: str) -> None:
    (tmp_path / "busy.py").write_text(_BUSY)
    folder = tmp_path / "began"
    folder.mkdir()
    parent = subprocess.Popen([sys.executable, "busy.py", str(folder)], cwd=tmp_path)
    try:
        while not list(folder.iterdir()):
            assert parent.poll() is None
            time.sleep(0.05)
        worker = int(next(folder.iterdir()).name)
        if whom.startswith("its"):
            parent.kill()
        else:
            os.kill(worker, signal.SIGTERM)
        for _ in range(200):
            if not _alive(worker):
                break
            time.sleep(0.05)
        assert not _alive(worker)
    finally:
        parent.kill()
        parent.wait()
