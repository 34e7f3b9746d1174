"""Runs with many output points: what is written as it comes is what a run in memory gives, whatever the pieces are."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest
from examples import VAN_DER_POL, experiment, inline, sinusoid
from interrupting import interrupt_writing

from hgorun import Experiment
from hgorun.engine import window
from hgorun.result.file.writing import digests_of
from hgorun.result.hdf5 import digests, writer
from hgorun.result.reading import read
from hgorun.simulation import long_run, simulate
from hgorun.simulation.simulate import prepare, simulate_into, simulate_prepared
from hgorun.tables.metrics import text

SHGO = {"type": "shgo", "theta": 3, "poles": -1}
FHGO = {"type": "fhgo2", "theta": 3, "r": 1, "poles": -1}
SAMPLED = {"sampling": {"period": 0.13}, "delay": 0.05, "noise": [{"type": "gaussian", "std": 0.1}]}
NOISY = {"noise": sinusoid(0.1, 50.0)}
CUBIC = inline({"a": "b - a**3", "b": "-a + u"}, {"y": "a", "z": "a + b"}, inputs={"u": "sin(t)"})


def _of(
    plant: dict[str, Any] = VAN_DER_POL, measurement: dict[str, Any] = NOISY, *, output_step: float = 0.01, **more: Any
) -> Experiment:
    more.setdefault("solver", {"method": "rk4", "step": 0.05})
    observers = more.pop("observers", {"S": SHGO, "F": FHGO})
    return experiment(plant, observers, end=2.0, output_step=output_step, measurement=measurement, **more)


CASES: dict[str, Callable[[], Experiment]] = {
    "continuous": _of,
    "sampled and delayed": lambda: _of(measurement=SAMPLED),
    "metrics at every third point": lambda: _of(metrics={"record": 0.03}),
    "output at every fourth point": lambda: _of(output_step=0.04, metrics={"record": 0.01}),
    "several outputs, an input": lambda: _of(CUBIC, observers={"S": SHGO}),
    "phases of sampling": lambda: _of(
        measurement={
            "phases": [{"until": 0.7, "sampling": {"period": 0.1}}, {"until": 9, "sampling": {"period": 0.07}}]
        }
    ),
    "controlled steps": lambda: _of(solver={"method": "dopri5", "rtol": 1e-6, "atol": 1e-9}),
    "a start of its own": lambda: _of(measurement=SAMPLED, time={"start": 100.0, "end": 102.0, "output_step": 0.01}),
}
SHORTER: dict[str, Callable[[], Experiment]] = {  # what is written from whole trajectories
    "one state": lambda: _of(inline({"a": "-a + sin(t)"}, "a"), observers={"S": SHGO}),
    "phases": lambda: _of(measurement={"phases": [{"until": 0.7, **NOISY}, {"until": 9, "sampling": {"period": 0.1}}]}),
    "continuous delay": lambda: _of(measurement={"delay": 0.1}),
    "an observer that diverges": lambda: _of(observers={"S": {**SHGO, "theta": 300}, "F": FHGO}),
    "no observer": lambda: _of(observers={}),
}


@pytest.fixture
def long(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Every run counts as one with many points, whose rows come a few at a time and are written a few at a time."""
    monkeypatch.setattr(simulate, "LONG", 1)
    monkeypatch.setattr(window, "_ROOM", 8 * 60)
    monkeypatch.setattr(writer, "_CHUNK", 5 * 16)
    return monkeypatch


def _digests(path: Path) -> dict[str, str]:
    with h5py.File(path) as file:
        return digests.of_file(file)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES, *SHORTER])
@pytest.mark.measured("several outputs, an input", "an observer that diverges", "no observer")
def test_what_is_written_as_it_comes_is_what_memory_holds(name: str, long: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = prepare((CASES | SHORTER)[name]())
    path = tmp_path / "a.h5"
    found = simulate_into(run, path)
    assert (found.time.size == 0) == (name in CASES)
    long.setattr(simulate, "LONG", 10**9)
    result = simulate_prepared(run)
    assert _digests(path) == digests_of(result)
    back = read(path)
    assert found.end == result.time[-1] == back.end
    assert text([found]) == text([back])
    assert back.status == result.status
    assert list(back.observers) == list(result.observers)
    assert back.troubles() == result.troubles()
    for label, error in (result.integration_error or {}).items():
        assert (back.integration_error or {})[label] == pytest.approx(error, rel=0.1)


@pytest.mark.costly
@pytest.mark.parametrize("room", [1, 2, 7, 10_000])
def test_pieces_of_any_size_give_the_same_file(room: int, long: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Their borders lie at events, between them, and at the end of the run."""
    run = prepare(_of(measurement=SAMPLED))
    rows = run.structure.system.states
    long.setattr(window, "_ROOM", 8 * rows * room)
    long.setattr(writer, "_CHUNK", 8 * room)
    found = simulate_into(run, tmp_path / "a.h5")
    assert found.time.size == 0
    long.setattr(simulate, "LONG", 10**9)
    assert _digests(tmp_path / "a.h5") == digests_of(simulate_prepared(run))


def test_an_automatic_step_is_the_same_in_a_file_and_in_memory(long: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It is found with fewer points; the error of the metrics, which are made of all of them, is as was asked for."""
    long.setattr(long_run, "_LOOKED_AT", 50)
    long.setattr(long_run, "_OF_A_WINDOW", 10)
    run = prepare(_of(measurement=SAMPLED, solver={"accuracy": 1e-4}))
    simulate_into(run, tmp_path / "a.h5")
    in_memory = simulate_prepared(run)
    assert _digests(tmp_path / "a.h5") == digests_of(in_memory)
    exact = simulate_prepared(prepare(_of(measurement=SAMPLED, solver={"method": "dopri5", "step": 1e-3})))
    for label, observer in in_memory.observers.items():
        for name in ("rmse", "sup", "peak"):
            assert observer.metrics[name] == pytest.approx(exact.observers[label].metrics[name], rel=1e-4)


@pytest.mark.parametrize("after", [0, 1, 5])
def test_an_interruption_leaves_nothing(after: int, long: pytest.MonkeyPatch, tmp_path: Path) -> None:
    interrupt_writing(long, after)
    with pytest.raises(KeyboardInterrupt):
        simulate_into(prepare(_of()), tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


_MEMORY = """
import resource, sys
from pathlib import Path
from hgorun import Experiment
from hgorun.simulation.simulate import prepare, simulate_into
points = int(sys.argv[1])
simulate_into(prepare(Experiment({
    "time": {"end": 100.0, "output_step": 100.0 / points},
    "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}},
    "measurement": {"sampling": {"period": 0.5}},
    "observers": {
        "S": {"type": "shgo", "theta": 3, "poles": -1},
        "F": {"type": "fhgo2", "theta": 3, "r": 1, "poles": -1},
    },
})), Path(sys.argv[2]))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the unit of ru_maxrss is that of Linux")
def test_memory_does_not_grow_with_trajectories(tmp_path: Path) -> None:
    """What grows are the times of the output points; their rows would take some 300 bytes each."""
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    few, many = 1_200_000, 4_000_000
    taken = [
        1024 * int(subprocess.check_output([sys.executable, "-c", _MEMORY, str(points), str(tmp_path / "a.h5")]))
        for points in (few, many)
    ]
    assert taken[1] - taken[0] <= 24 * (many - few)
