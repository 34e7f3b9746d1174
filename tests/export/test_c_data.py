"""Configurations with recorded data are exported, too: the C gives the numbers of ``hgorun estimate``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from exported_c import load_all
from shell import Shell

from hgorun.config.reading import read_source
from hgorun.errors import ConfigError
from hgorun.estimate.carrying import one_pass
from hgorun.estimate.completed import completed
from hgorun.estimate.log import log_of
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.export.fmu_variables import variables_of
from hgorun.export.prepared import exported_estimate
from hgorun.measurement.schedule import nearest_event

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: -sin(a) - b/10 + u + w}
  inputs: {w: 0.1*sin(t)}
  output: [a, b]
data:
  time: t
  outputs:
    a: position
    b: {file: late.csv, column: speed, time: taken, available: known}
  inputs: {u: {column: force, hold: linear}}
measurement: {noise: [{type: gaussian, std: 0.1}]}
observers:
  F: {type: fhgo2, r: 1, theta: 2, initial: {b: 1}}
  R: {type: shgo_riccati, theta: 2}
solver: {step: 0.01}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A log of irregular samples, and a laboratory whose values are known late."""
    random = np.random.default_rng(3)
    times = np.cumsum(random.uniform(0.05, 0.15, 60))
    rows = [f"{t:.3f},{np.sin(t):.6f},{np.cos(2 * t):.6f}" for t in times]
    (tmp_path / "log.csv").write_text("\n".join(["t,position,force", *rows, ""]))
    late = [f"{t:.3f},{t + 0.3 + 0.1 * (k % 3):.3f},{np.cos(t):.6f}" for k, t in enumerate(times[5:50:9])]
    (tmp_path / "late.csv").write_text("\n".join(["taken,known,speed", *late, ""]))
    (tmp_path / "config.yaml").write_text(CONFIG.replace("time: t\n", "time: t\n  file: log.csv\n"))
    return tmp_path


def prepared_of(folder: Path) -> PreparedEstimate:
    config = folder / "config.yaml"
    text, source = read_source(config, ())
    recording = log_of(source, config).read()
    return prepare_estimate(completed(source, recording, "config", text), recording)


@pytest.mark.costly
def test_numbers(folder: Path) -> None:
    prepared = prepared_of(folder)
    run, events = prepared.run, prepared.run.schedule.events
    rows = one_pass(prepared, events, 0.01)[0].rows[:, :, 0]
    theirs = run.structure.estimates_along(events, run.numbers.p, rows, prepared.held(events))
    assert prepared.inputs is not None
    changes = events[nearest_event(events, prepared.inputs.times)]
    arriving: list[list[tuple[float, float, int]]] = [[] for _ in events]
    for i, one in enumerate(prepared.samples):
        at, taken = nearest_event(events, one.available), events[nearest_event(events, one.taken)]
        for k in range(one.values.size):
            arriving[at[k]].append((float(taken[k]), float(one.values[k]), i))
    for j, observer in enumerate(load_all(folder, exported_estimate(prepared)).values()):
        assert observer.observer.inputs == ("u",)
        own = []
        for t, samples in zip(events, arriving, strict=True):
            assert observer.predict(t) == 0
            for i in np.flatnonzero(changes == t).tolist():
                end = changes[i + 1] if i + 1 < changes.size else events[-1]
                level, slope = prepared.inputs.levels[i], prepared.inputs.slopes[i]
                assert observer.input(t, level) == observer.input(end, level + slope * (end - t)) == 0
            for taken, y, i in samples:
                assert observer.update(taken, [y, y], 1 << i) == 0
            own.append(observer.estimate)
        expected = np.asarray(theirs.of(j))
        assert np.ptp(expected) > 0.5
        np.testing.assert_allclose(own, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


def test_the_command(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    shell = Shell(folder, monkeypatch, capsys)
    code, out, err = shell("export", "config.yaml", "--json", "--set", "solver.step=auto")
    assert (code, err) == (0, "")
    found = json.loads(out)["observers"]["F"]
    assert (found["inputs"], found["outputs"]) == (["u"], ["a", "b"])
    assert 0 < found["step"] < 0.5
    assert "HGO_F_HISTORY" in Path("results/config/F.h").read_text()
    code, _, err = shell("export", "config.yaml", "--set", "data.outputs.a={column: position, gate: 4}", "-q")
    assert code == 0
    assert "gates are not exported" in err
    shell("export", "config.yaml", "--set", "solver={}", "--set", "observers.R.theta=60", "--observer", "F", "-o", "a")
    shell("export", "config.yaml", "--set", "solver={}", "--set", "observers.R=null", "-o", "b")
    assert Path("a/F.h").read_bytes() == Path("b/F.h").read_bytes()
    code, _, err = shell("export", "config.yaml", "--set", "solver.method=rodas5p")
    assert (code, "rodas5p solves linear equations" in err) == (2, True)


def test_units_and_the_start_are_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is converted in exported code, and its start is the log's."""
    shell = Shell(folder, monkeypatch, capsys)
    changes = ["plant.units={a: rad, b: rad/s, u: N}", "data.outputs.a={column: position, unit: deg}"]
    given = [part for change in changes for part in ("--set", change)]
    code, out, err = shell("export", "config.yaml", "--observer", "F", *given)
    assert code == 0
    assert err.splitlines() == [
        "hgorun: config: data.outputs.a.unit: exported observers convert no values from deg: send them in rad"
    ]
    first = float((folder / "log.csv").read_text().splitlines()[1].split(",")[1])
    begun = f"a = {np.deg2rad(first):.6g} from the first sample of the log"
    header = Path("results/config/F.h").read_text()
    for line in (
        "Units of y: a in rad, b in rad/s; nothing is converted.",
        "Units of u: u in N; nothing is converted.",
        "Units of xhat: a in rad, b in rad/s; nothing is converted.",
        f"It starts at {begun}.",
    ):
        assert f" * {line}\n" in header
    assert f"/* At the start of the run: {begun}. */" in header
    assert f"  starts at {begun}\n" in out


def test_the_variables_of_a_unit_say_their_units_and_where_estimates_start(folder: Path) -> None:
    config = folder / "config.yaml"
    config.write_text(config.read_text().replace("plant:\n", "plant:\n  units: {a: rad, u: N}\n"))
    meanings = {one.name: one.meaning for one in variables_of(exported_estimate(prepared_of(folder))[0])}
    assert meanings["time"] == "time of the simulation, in s"
    assert meanings["y.a"] == "output of the plant, as measured, in rad"
    assert meanings["y.b"] == "output of the plant, as measured"
    assert meanings["age.b"] == "how long ago the sample was taken, in s"
    assert meanings["u.u"] == "input of the plant, in N"
    assert meanings["xhat.a"] == "estimate, in rad; starts from the first sample of the log"
    assert meanings["xhat.b"] == "estimate"


def test_an_observer_that_goes_back_in_time_is_not_exported(folder: Path) -> None:
    config = folder / "config.yaml"
    config.write_text(config.read_text().replace("type: shgo_riccati", "late: replay, type: shgo_riccati"))
    with pytest.raises(ConfigError, match=r"take data\.outputs\.b\.available out; to export the others: --observer F$"):
        exported_estimate(prepared_of(folder))
