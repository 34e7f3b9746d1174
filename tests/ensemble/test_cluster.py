"""Ensembles on a scheduler of dask.distributed with two workers, one of which is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ensembles import ensemble, small

from hgorun.ensemble import cluster
from hgorun.ensemble.cluster import dask, on_worker
from hgorun.ensemble.collecting import collect
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.fingerprint import own_code
from hgorun.ensemble.members.recipe import recipe_of
from hgorun.ensemble.sweep import Count, Place, carry_out, sweep_to
from hgorun.errors import ConfigError, HgorunError, SimulationError
from hgorun.version import __version__

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed: pip install 'hgorun[dask]'")


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a scheduler, and its two workers."""
    file = tmp_path / "scheduler.json"
    path = os.pathsep.join(sys.path)  # the workers see the same hgorun

    def start(*arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{arguments[0]}", *arguments[1:], "--no-dashboard"]
        environment = {**os.environ, "PYTHONPATH": path}
        return subprocess.Popen(
            [*command, "--scheduler-file", str(file)], stderr=subprocess.DEVNULL, env=environment, cwd=tmp_path
        )

    started = [start("scheduler", "--host", "127.0.0.1", "--port", "0")]
    try:
        started += [start("worker", "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1") for _ in range(2)]
        for _ in range(600):
            if file.exists() and file.stat().st_size:
                break
            time.sleep(0.1)
        yield str(json.loads(file.read_text())["address"]), started[1:]
    finally:
        for process in started:  # not asked to end: without its scheduler a worker may wait for ever
            process.kill()
        for process in started:
            process.wait()


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a library, when a worker dies
def test_a_killed_worker_costs_its_block_only(
    tmp_path: Path, processes: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = processes
    of = ensemble({"observers.*.theta": {"log": [2, 20, 8]}, "seed": {"count": 40}}, keep={"metrics": ["rmse"]})
    undisturbed = Place.of(tmp_path / "undisturbed.h5")
    sweep_to(of, undisturbed)
    store = Store.opened(tmp_path / "a.sweep", of)
    with distributed.Client(address) as client:
        client.wait_for_workers(2, timeout=60)

    def kill(count: Count) -> None:
        if count.done and workers[0].poll() is None:
            workers[0].send_signal(signal.SIGKILL)
            workers[0].wait()

    carry_out(store, dask(address), workers=2, told=kill)
    assert workers[0].poll() == -signal.SIGKILL
    collect(store, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == undisturbed.file.read_bytes()


def test_a_worker_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe, code = recipe_of(small()), dict(own_code())
    assert len(on_worker(recipe, 0, 2, __version__, code).block) == 2
    with pytest.raises(SimulationError, match=r"a worker has hgorun .* instead of 9\.9\.9"):
        on_worker(recipe, 0, 2, "9.9.9", code)
    with pytest.raises(SimulationError, match=r"a worker has other code: engine; install the same version"):
        on_worker(recipe, 0, 2, __version__, code | {"engine": "0"})


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_WAIT", 0.5)
    store = Store.opened(tmp_path / "a.sweep", small())
    with pytest.raises(HgorunError, match=r"--scheduler tcp://127\.0\.0\.1:9: "):
        carry_out(store, dask("tcp://127.0.0.1:9"))


def test_what_is_no_address_is_wrong_input(tmp_path: Path) -> None:
    store = Store.opened(tmp_path / "a.sweep", small())
    with pytest.raises(ConfigError, match="--scheduler foo: not an address such as"):
        carry_out(store, dask("foo"))


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    store = Store.opened(tmp_path / "a.sweep", small())
    with pytest.raises(HgorunError, match=r"pip install 'hgorun\[dask\]'"):
        carry_out(store, dask(None))
