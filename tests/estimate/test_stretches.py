"""Logs that are gone through stretch by stretch: what is written is what the whole at once gives, bit by bit."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from examples import inline
from interrupting import interrupt_writing
from recordings import NOISE, held_input, observers, recording, signal, source

from hgorun.data.recording import Recording, Signal
from hgorun.estimate import prepared
from hgorun.estimate.estimate import estimate
from hgorun.estimate.long import long_found, long_log, stretches
from hgorun.estimate.long.long_log import estimate_into
from hgorun.estimate.scores import innovations
from hgorun.estimate.scores.innovations import WrittenInnovations
from hgorun.measurement import schedule
from hgorun.result.file.parts import ResultInParts
from hgorun.result.file.writing import digests_of
from hgorun.result.hdf5 import digests
from hgorun.result.reading import read
from hgorun.result.result import Result
from hgorun.simulation.timeline import tabulated
from hgorun.simulation.timeline.actions import Actions

COUNT = 300
PLANT = inline(
    {"a": "b + c", "b": "-sin(a) - 0.1*b + u + 0.1*abs(sin(2*t))", "c": "0"}, {"a": "a", "d": "b"}, inputs={"u": "0"}
)
DRAWN = np.random.default_rng(5)
TIMES = np.sort(DRAWN.uniform(0.0, 6.0, COUNT))
TIMES[40] = TIMES[41]  # twice at one time
OTHERS = np.sort(DRAWN.uniform(0.4, 6.0, 90))
OF_INPUT = np.linspace(-0.3, 6.5, 131)
OUTPUTS = (
    signal("a", TIMES, np.sin(TIMES) + 0.01 * DRAWN.standard_normal(COUNT)),
    signal("d", OTHERS, np.cos(OTHERS) + 0.01 * DRAWN.standard_normal(90)),
)
ASIDE = {"a": signal("a", TIMES[5:290:7] + 1e-3, np.sin(TIMES[5:290:7]))}
SLOW = {"b": signal("b", OTHERS[::9], np.cos(OTHERS[::9]))}
FIXED: dict[str, Any] = {"solver": {"step": 0.02}}


def _log(hold: str = "zero", *, start: float = 0.0, reference: dict[str, Signal] | None = None) -> Recording:
    outputs = (signal(one.name, one.taken + start, one.values) for one in OUTPUTS)
    return recording(*outputs, reference=reference, u=held_input("u", OF_INPUT + start, np.sin(OF_INPUT), hold))


def _both(
    log: Recording,
    path: Path,
    *types: str,
    held_out: dict[str, Signal] | None = None,
    sensitivity: bool = False,
    **more: Any,
) -> tuple[Result, Result | None]:
    """At once, and stretch by stretch."""
    plant = {key: value for key, value in PLANT.items() if key not in ("inputs", "initial")}
    start = {"a": 0.0, "b": 1.0}
    config = source(
        {"plant": plant, "observers": observers(*types, initial=start), "measurement": {"noise": NOISE}, **more}
    )
    given: dict[str, Any] = {"name": "x", "text": "y", "held_out": held_out or {}, "sensitivity": sensitivity}
    return estimate(config, log, **given), estimate_into(config, log, path, **given)


def _digests(path: Path) -> dict[str, str]:
    with h5py.File(path) as file:
        return digests.of_file(file)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Every log counts as a long one."""
    monkeypatch.setattr(long_log, "LONG", 10)
    monkeypatch.setattr(stretches, "_STRETCH", 37)
    return monkeypatch


@pytest.mark.measured("log1-more1")
@pytest.mark.costly
@pytest.mark.parametrize(
    ("log", "more"),
    [
        (_log(), FIXED),
        (_log("linear"), {"held_out": ASIDE}),
        (_log(start=1e6, reference={"b": signal("b", OTHERS[::9] + 1e6, np.cos(OTHERS[::9]))}), {}),
        (_log(), FIXED | {"time": {"start": 0.0, "end": 6.0, "output_step": 0.01}}),
        (_log(reference={**SLOW, "a": replace(ASIDE["a"], lag=0.1)}), {}),
        (_log(reference={"b": replace(SLOW["b"], lag=0.5)}), FIXED),
        (_log(reference=SLOW), FIXED | {"held_out": ASIDE, "time": {"start": 1.0, "end": 5.0, "output_step": 0.3}}),
    ],
)
def test_what_is_written_is_that_of_the_whole(
    log: Recording, more: dict[str, Any], short: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    whole, found = _both(log, tmp_path / "a.h5", "shgo", "fhgo2", **more)
    assert found is not None
    assert _digests(tmp_path / "a.h5") == digests_of(whole)
    back = read(tmp_path / "a.h5")
    assert back.troubles() == found.troubles() == whole.troubles()
    assert back.integration is not None
    assert whole.integration is not None
    assert back.integration.step == whole.integration.step
    for label, error in (whole.integration_error or {}).items():
        assert error / 4 < (back.integration_error or {})[label] < 4 * error


@pytest.mark.costly
def test_points_at_samples_are_those_of_the_whole(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Stamps that are sums lie behind the multiples of a step, those of the input before, and one sample is missing."""
    even = np.cumsum(np.full(COUNT, 0.02)) - 0.02
    y, t = np.sin(even), np.delete(even + 3.6, 150)
    log = recording(
        signal("a", t, np.delete(y, 150)),
        signal("d", even[::3] + 3.6, np.cos(even[::3])),
        u=held_input("u", 3.6 + 0.02 * np.arange(COUNT) - 1e-12, y),
        reference={"b": signal("b", t[5::9] - 1e-12, np.cos(t[5::9] - 3.6))},
    )
    of_time = {"start": 3.6, "end": float(even[-1]) + 3.61, "output_step": 0.02}
    more: dict[str, Any] = {"time": of_time, "solver": {"step": 1e-3}}
    whole, found = _both(log, path := tmp_path / "a.h5", "shgo", "fhgo2", **more)
    assert found is not None
    assert _digests(path) == digests_of(whole)
    np.testing.assert_array_equal(whole.time, even + 3.6)


@pytest.mark.costly
def test_times_that_are_equal_are_stored_once(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Under the names that each of them has, for every reader."""
    t = np.linspace(0.0, 6.0, COUNT)
    log = recording(signal("a", t, np.sin(t)), signal("d", t, np.cos(t)), u=held_input("u", t, np.sin(t), "zero"))
    whole, found = _both(log, path := tmp_path / "a.h5", "shgo", **FIXED)
    assert found is not None
    assert _digests(path) == digests_of(whole)
    of_times = [f"measurement/{output}/{name}" for output in "ad" for name in ("time", "taken", "available")]
    with h5py.File(path) as file:
        assert len({file[name].id.get_offset() for name in of_times}) == 1
        assert file["measurement/a/number"].id.get_offset() == file["measurement/d/number"].id.get_offset()
    back = read(path)
    assert back.recorded is not None
    for one in back.recorded.outputs.values():
        np.testing.assert_array_equal([one.taken, one.available], [t, t])
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(path, group="measurement/d", engine="h5netcdf") as data:
        assert data.sizes["number"] == COUNT
        np.testing.assert_array_equal(data["taken"], t)
        np.testing.assert_array_equal(data["number"], np.arange(COUNT))


@pytest.mark.measured("5")
@pytest.mark.costly
@pytest.mark.parametrize("size", [5, 64, 1000])
def test_stretches_of_any_size_give_the_same_file(size: int, short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short.setattr(stretches, "_STRETCH", size)
    whole, found = _both(_log("linear"), tmp_path / "a.h5", "shgo", **FIXED)
    assert found is not None
    assert _digests(tmp_path / "a.h5") == digests_of(whole)


@pytest.mark.costly
@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_a_log_of_one_clock_gives_the_same_file(hold: str, short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Everything happens at the samples: no other events have to be looked for."""
    t = np.cumsum(DRAWN.uniform(0.01, 0.03, COUNT)) + 5.0
    log = recording(signal("a", t, np.sin(t)), signal("d", t, np.cos(t)), u=held_input("u", t, np.sin(3 * t), hold))
    smooth = PLANT | {"dynamics": {"a": "b + c", "b": "-sin(a) - 0.1*b + u", "c": "0"}}
    short.setitem(globals(), "PLANT", smooth)
    counted: list[Any] = []

    def counting(*given: Any) -> schedule.Schedule:
        counted.append(given)
        return schedule.build_schedule(*given)

    sizes: list[int] = []

    class CountedActions(Actions):
        def __init__(self, of: schedule.Schedule, *others: Any) -> None:
            sizes.append(of.events.size)
            super().__init__(of, *others)

    short.setattr(stretches, "build_schedule", counting)
    short.setattr(tabulated, "_PART_EVENTS", 8)
    short.setattr(tabulated, "Actions", CountedActions)
    whole, found = _both(log, tmp_path / "a.h5", "shgo", **FIXED)
    assert found is not None
    assert len(counted) == 1  # of the last stretch, which ends with a sample
    # the first stretch has its own, with even steps and others; all behind it that have as many samples have the same
    assert sizes.count(37 + 1) == 3
    assert _digests(tmp_path / "a.h5") == digests_of(whole)


@pytest.mark.parametrize(
    ("hold", "step", "jitter"),
    [
        ("zero", 0.03, 9e-3),
        *(pytest.param(*one, 0.0, marks=pytest.mark.costly) for one in [("zero", 0.03), ("linear", 0.007)]),
    ],
)
def test_segments_that_are_alike_need_no_tables(
    hold: str, step: float, jitter: float, short: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of a log with as many steps from each sample to the next: what is told of one segment is that of all."""
    t = np.round(0.02 * np.arange(120), 2) + jitter * np.sin(np.arange(120))
    log = recording(signal("a", t, np.sin(t)), signal("d", t, np.cos(t)), u=held_input("u", t, np.sin(3 * t), hold))
    smooth = PLANT | {"dynamics": {"a": "b + c", "b": "-sin(a) - 0.1*b + u", "c": "0"}}
    short.setitem(globals(), "PLANT", smooth)
    short.setattr(tabulated, "_PART_EVENTS", 8)
    made: list[bool] = []

    class Told(tabulated.Tabulated):
        def alike(self) -> tabulated.Tables | None:
            found = super().alike()
            made.append(found is not None)
            return found

    class Tabled(tabulated.Tabulated):
        def alike(self) -> None:
            return None

    in_tables = "hgorun.simulation.timeline.tables.Tabulated"
    short.setattr(in_tables, Tabled)
    _, expected = _both(log, tmp_path / "a.h5", "shgo", "fhgo2", solver={"step": step})
    short.setattr(in_tables, Told)
    whole, found = _both(log, tmp_path / "a.h5", "shgo", "fhgo2", solver={"step": step})
    assert found is not None
    assert expected is not None
    assert found.integration_error == expected.integration_error
    # all stretches but the last, which ends with a sample; the first two with other steps as well
    assert made.count(True) == 5
    assert _digests(tmp_path / "a.h5") == digests_of(whole)


@pytest.mark.parametrize("some", [slice(None), slice(3, None, 1), slice(7, None, 9), slice(40, None)])
def test_innovations_are_read_again(some: slice, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(innovations, "_ROWS", 4)
    values = DRAWN.standard_normal((30, 2))
    with ResultInParts(tmp_path / "a.h5", 2) as file:
        for rows in (values[:11], values[11:]):
            file.append("measurement/a/innovation", rows, 30)
        read = WrittenInnovations(file.whole("measurement/a/innovation"), 30)
        for j in range(2):
            np.testing.assert_array_equal(read.of(j, some), values[some, j])


@pytest.mark.parametrize(("step", "status"), [(0.09, "inaccurate"), ("auto", "ok")])
def test_an_observer_that_steps_alone_lose(step: Any, status: str, short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short.setattr(prepared, "nominal_step", lambda one: 0.09 if one.given_step is None else one.given_step)
    blocks = {"fast": {"type": "shgo", "poles": -1, "theta": 40.0, "initial": {"a": 0.0, "b": 1.0}}}
    plant = {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-sin(a)"}, "output": "a"}
    config = source({"plant": plant, "observers": blocks, "measurement": {"noise": NOISE}, "solver": {"step": step}})
    taken = np.arange(120) / 10
    log = recording(signal("a", taken, np.sin(taken)))
    found = estimate_into(config, log, tmp_path / "a.h5", name="x", text="y", held_out={}, sensitivity=False)
    assert found is not None
    assert found.observers["fast"].verdict.status == status


@pytest.mark.costly
def test_an_observer_that_is_lost_stays_so(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    whole, found = _both(_log(), tmp_path / "a.h5", "shgo", solver={"step": 0.02, "divergence": 0.9})
    assert found is not None
    assert whole.status == found.status == "diverged"
    assert found.troubles() == whole.troubles()
    assert _digests(tmp_path / "a.h5") == digests_of(whole)


@pytest.mark.costly
def test_what_is_said_stands_in_the_file(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short.setattr("hgorun.estimate.estimate._MOST", 10)
    whole, found = _both(_log(), tmp_path / "a.h5", "shgo", sensitivity=True, **FIXED)
    assert found is not None
    assert read(tmp_path / "a.h5").remarks == found.remarks == whole.remarks
    assert any("samples: how the scores depend on the gains" in told for told in found.remarks)


def test_a_picture_has_some_of_the_points(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short.setattr(long_found, "_SHOWN", 50)
    whole, found = _both(_log(), tmp_path / "a.h5", "shgo", **FIXED)
    assert found is not None
    assert found.recorded is not None
    assert whole.recorded is not None
    every = -(-whole.time.size // 50)
    assert np.array_equal(found.time, whole.time[::every])
    assert np.array_equal(found.observers["shgo"].xhat, whole.observers["shgo"].xhat[::every])
    assert np.array_equal(found.recorded.outputs["a"].y, whole.recorded.outputs["a"].y[:: -(-COUNT // 50)])


def test_steps_that_are_too_long_are_found_on_the_way(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What was written with them is written anew."""
    whole, found = _both(_log(), tmp_path / "a.h5", "shgo", solver={"accuracy": 1e-10})
    assert found is not None
    assert found.integration is not None
    assert whole.integration is not None
    assert found.integration.step is not None
    assert whole.integration.step is not None
    assert max((found.integration_error or {}).values()) <= 1e-10
    ratio = np.log2(whole.integration.step / found.integration.step)
    assert abs(ratio) <= 1
    assert ratio == round(ratio)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("change", ["late", "gate", "jumps", "short"])
def test_what_needs_the_whole_is_left_to_it(change: str, short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    a, d = OUTPUTS
    if change == "late":
        a = signal("a", a.taken, a.values, a.taken + 0.1)
    if change == "gate":
        a = signal("a", a.taken, a.values, gate=4.0)
        a = Signal(**{**vars(a), "available": a.taken})
    if change == "short":
        short.setattr(long_log, "LONG", 10_000)
    log = recording(a, d, u=held_input("u", OF_INPUT, np.sin(OF_INPUT)))
    plant = {key: value for key, value in PLANT.items() if key not in ("inputs", "initial")}
    which = {"K": {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01}} if change == "jumps" else observers("shgo")
    config = source({"plant": plant, "observers": which, "measurement": {"noise": NOISE}, **FIXED})
    path = tmp_path / "a.h5"
    assert estimate_into(config, log, path, name="x", text="y", held_out={}, sensitivity=False) is None
    assert not path.exists()


def test_nobody_asks_for_all_output_points(short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short.setattr("hgorun.simulation.experiment.observed.grid_of", None)
    plant = inline({"a": "b", "b": "c", "c": "-a"}, {"a": "a"})
    del plant["initial"]
    config = source({"plant": plant, "observers": observers("shgo", initial={"b": 1.0}), **FIXED})
    path = tmp_path / "a.h5"
    assert estimate_into(config, recording(OUTPUTS[0]), path, name="x", text="y", held_out={}, sensitivity=False)


@pytest.mark.parametrize("after", [0, 40])
def test_an_interruption_leaves_nothing(after: int, short: pytest.MonkeyPatch, tmp_path: Path) -> None:
    interrupt_writing(short, after)
    with pytest.raises(KeyboardInterrupt):
        _both(_log(), tmp_path / "a.h5", "shgo", **FIXED)
    assert list(tmp_path.iterdir()) == []


_CONFIG = """
data: {file: log.csv, time: t, outputs: {a: a, d: d}, inputs: {u: {column: u, hold: zero}}}
plant: {states: [a, d], dynamics: {a: d, d: -a + u}, output: {a: a, d: d}}
observers: {S: {type: shgo, theta: 3, poles: -1}}
solver: {step: 1.0e-3}
"""
_MEASURED = """
import resource, sys
from hgorun.cli import main
sys.argv = ["hgorun", "estimate", "log.yaml", "-o", "log.h5", "--no-plots", "--quiet"]
try:
    main()
except SystemExit:
    pass
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def _write_log(path: Path, seconds: int) -> None:
    """A thousand rows a second, each second with the same values: texts of rows are made once."""
    t = np.arange(1000) / 1000
    values = np.column_stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t), 0.1 * np.sin(6 * np.pi * t)])
    rows = [f".{number:03d},{a:.5f},{d:.5f},{u:.5f}\n" for number, (a, d, u) in enumerate(values)]
    with path.open("w") as file:
        file.write("t,a,d,u\n")
        for second in range(seconds):
            file.write(str(second).join(["", *rows]))


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the unit of ru_maxrss is that of Linux")
def test_memory_is_a_small_multiple_of_the_log(tmp_path: Path) -> None:
    taken, sizes = [], []
    (tmp_path / "log.yaml").write_text(_CONFIG)
    for seconds in (600, 2000):
        _write_log(tmp_path / "log.csv", seconds)
        said = subprocess.check_output([sys.executable, "-c", _MEASURED], cwd=tmp_path, text=True)
        taken.append(1024 * int(said.split()[-1]))
        sizes.append((tmp_path / "log.csv").stat().st_size)
    assert taken[1] - taken[0] <= 3 * (sizes[1] - sizes[0])
