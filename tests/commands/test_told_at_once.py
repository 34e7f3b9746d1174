"""Faults that do not follow from each other are told in one run, wherever they are found."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from shell import Shell

import hgorun
from hgorun.config.refusals import Refusals, of_other_blocks
from hgorun.errors import ConfigError, PluginError, Problem

TIME = "time: {end: 5, output_step: 0.1}\n"
PLANT = "plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}\n"
TANK = "plant: {states: [h], dynamics: {h: -h + u}, output: {y: h}, inputs: {u: 0}}\n"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


def told(shell: Shell, *words: str) -> dict[str, str]:
    """What is said of ``c.yaml``, by the key that is wrong."""
    code, out, err = shell(*words)
    assert (code, out) == (2, "")
    parts = [line.removeprefix("hgorun: c.yaml:").split(": ", 2) for line in err.splitlines()]
    found = {key: message for _, key, message in parts}
    assert len(found) == len(parts), err
    return found


def test_of_several_observers_and_of_the_metrics(shell: Shell) -> None:
    observers = """observers:
  A: {type: shgo, theta: 5, initial: {x9: 1, x7: 2}}
  B: {type: shgo, theta: 5, gains: [1]}
  C: {type: ekf, q: 1, internal: {P: [1, 2, 3]}}
  E: {type: shgo, theta: 5}
"""
    (shell.folder / "c.yaml").write_text(f"{TIME}{PLANT}{observers}metrics: {{window: [7, 9]}}\n")
    found = told(shell, "simulate", "c.yaml")
    keys = ["metrics.window", "observers.A.initial", "observers.B.gains", "observers.C.internal.P"]
    assert list(found) == keys
    assert found["observers.A.initial"] == "unknown state 'x9' and 'x7'; known here: x1, x2. Did you mean `x2`?"


def test_of_a_window_beside_a_name_that_is_not_known(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(
        f"{TIME}plant: {{states: [h], dynamics: {{h: -k*h}}, output: {{y: h}}, initial: {{h: 1}}}}\n"
        "observers: {A: {type: shgo, theta: 5, initial: {g: 1}}}\nmetrics: {window: [7, 9]}\n"
    )
    assert list(told(shell, "simulate", "c.yaml")) == ["plant.dynamics.h", "metrics.window"]


def test_of_the_axes_of_a_sweep_and_of_what_is_kept(shell: Shell) -> None:
    base = f"base:\n  {TIME}  {PLANT}  observers: {{A: {{type: shgo, theta: 5}}}}\n"
    axes = """axes:
  observers.A.thetta: [1, 2]
  time.ende: [1, 2]
  observers.Z.theta: [1, 2]
  observers.A.theta: {log: [2, 3, 1]}
  theta: [1]
keep: {metrics: [rms, foo], quantities: ["rmse('A', x9)", "foo"]}
"""
    (shell.folder / "c.yaml").write_text(base + axes)
    keep = ["keep.quantities.0", "keep.quantities.1", "keep.metrics.0", "keep.metrics.1"]
    wrong = ["observers.A.thetta", "time.ende", "observers.Z.theta", "theta"]
    keys = ["axes.observers.A.theta", *keep, *(f"axes.{one}" for one in wrong)]
    assert list(told(shell, "sweep", "c.yaml")) == keys
    (shell.folder / "c.yaml").write_text(f"{base}axes: {{time.end: 3, seed: 0.5, solver.step: [], plant.seed: 4}}")
    assert list(told(shell, "sweep", "c.yaml")) == [
        "axes.time.end", "axes.seed", "axes.solver.step", "axes.plant.seed",
    ]  # fmt: skip
    wrong_base = base.replace("theta: 5}", "tehta: 5}, B: {type: shgoo}")
    (shell.folder / "c.yaml").write_text(f"{wrong_base}axes: {{observers.A.theta: [1, 2]}}\n")
    assert list(told(shell, "sweep", "c.yaml")) == ["base.observers.A.tehta", "base.observers.B.type"]


def test_of_the_columns_and_the_files_of_a_log(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,level,pump,head\n0,1,2,3\n1,2,3,4\n")
    (shell.folder / "c.yaml").write_text(
        f"{TANK}observers: {{A: {{type: shgo, theta: 5}}}}\n"
        "data: {file: log.csv, time: tiem, outputs: {y: {column: levle, available: knwon, quality: {column: good, "
        "good: [1]}}}, inputs: {u: pmup}, reference: {h: {column: haed, file: other.csv}}}\n"
    )
    found = told(shell, "estimate", "c.yaml")
    assert list(found) == [
        "data.outputs.y.column", "data.time", "data.outputs.y.available", "data.outputs.y.quality.column",
        "data.inputs.u", "data.reference.h.file",
    ]  # fmt: skip
    assert "no column 'levle'. Did you mean `level`?" in found["data.outputs.y.column"]
    assert shell("estimate", "c.yaml", "a.csv", "b.csv")[2].splitlines()[:2] == [
        "hgorun: c.yaml:3: data.reference.h.file: other.csv: there is no such file",
        "hgorun: a.csv: there is no such file",
    ]


def test_of_several_observers_of_a_log(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,level\n" + "".join(f"{k},{k}\n" for k in range(9)))
    (shell.folder / "c.yaml").write_text(
        f"{TANK}observers:\n  A: {{type: shgo, theta: 5, initial: {{g: 1}}}}\n"
        "  B: {type: shgo, theta: 5, poles: [-1, -2]}\n"
        "data: {file: log.csv, time: time, outputs: {y: level}}\n"
    )
    assert list(told(shell, "estimate", "c.yaml")) == ["observers.A.initial", "observers.B.poles"]


def test_of_each_other_block_the_first_fault_is_found() -> None:
    """What a class of somebody's own raises is said when it is the first."""

    def raising(error: Exception) -> object:
        raise error

    faults = [
        ConfigError("a", key="observers.A.theta"), PluginError("no"), ConfigError("b", key="observers.B"),
        ConfigError("c", key="observers.B.theta"), ConfigError("d", key="time.end"),
    ]  # fmt: skip
    told = [ConfigError("x", key="observers.A"), ConfigError("y", key="time")]
    found = of_other_blocks(told, [partial(raising, one) for one in faults])
    assert [one.message for one in found] == ["b"]


def test_what_has_no_place_yet_leads() -> None:
    """Whoever knows the file finds the places of all."""
    faults = Refusals()
    of_two = Problem(("k",), "b", (Problem(("l",), "c"),))
    for one in (ConfigError("a"), of_two, Problem(("k",), "b"), ConfigError("a")):
        with faults.of_a_part():
            raise one
    with pytest.raises(Problem) as caught:
        faults.refuse()
    assert (caught.value.message, [one.message for one in caught.value.others]) == ("b", ["a", "c"])


def test_of_a_measurement_with_a_key_that_is_not_known(shell: Shell) -> None:
    """Each item of its noise, whatever else is wrong with it, and not what an unknown key leaves out."""
    noise = "noise: [{type: gausian, std: 1}, {type: uniform, low: 2, hgh: 1}, {type: gaussian, std: 1}]"
    outputs = "outputs: {x1: {noise: [{type: uniform, low: 2, high: 1}], delay: -3}}"
    measurement = f"measurement: {{sampling: {{perod: 0.1}}, dely: 2, {noise}, {outputs}}}\n"
    observers = "observers: {S: {type: shgo, theta: 2}}\n"
    (shell.folder / "c.yaml").write_text(TIME + PLANT + observers + measurement)
    found = told(shell, "simulate", "c.yaml")
    places = ["sampling", "dely", "noise.0.type", "noise.1.hgh", "outputs.x1.noise.0", "outputs.x1.delay"]
    assert sorted(found) == sorted(f"measurement.{place}" for place in places)
    (shell.folder / "c.yaml").write_text(TIME + PLANT + observers + "measurement: {dely: 2}\n")
    assert list(told(shell, "simulate", "c.yaml")) == ["measurement.dely"]


def test_of_claims_beside_other_faults(shell: Shell) -> None:
    claims = """claims:
  - {id: "1", claim: x, value: "rmse(S, x1", below: 1}
  - {id: "2", claim: x, value: "rmse(Z, x1)", below: a}
  - {id: "3", claim: x, value: "rmse(S, x1)", below: 1}
  - 4
"""
    observers = "observers: {S: {type: shgo, theta: 2}}\n"
    (shell.folder / "c.yaml").write_text(TIME + PLANT + observers + "figures: {f: {panel: 3}}\n" + claims)
    found = told(shell, "simulate", "c.yaml")
    assert sorted(found) == ["claims.0.value", "claims.1.below", "claims.1.value", "claims.3", "figures.f.panel"]


RUNS = """observers: {A: {type: shgo, theta: 2}, B: {type: shgo, theta: 2, gains: [1]}}
runs:
  a: {observers: {A: {theta: -1}, B: {gains: [1, 1]}}}
  b: {measurement: {delay: -2}}
  c: {observers: {B: {poles: [-1, -2], gains: ~}, A: {gains: [3]}}}
"""


def test_of_runs_below_their_names(shell: Shell) -> None:
    """A key that a run says itself stands below its name, one that all of them share at its own place."""
    (shell.folder / "c.yaml").write_text(TIME + PLANT + RUNS)
    found = told(shell, "simulate", "c.yaml")
    assert list(found) == ["runs.a.observers.A.theta", "runs.b.measurement.delay", "runs.c.observers.A.gains"]
    right = RUNS.replace("theta: -1", "theta: 1").replace("delay: -2", "delay: 0")
    (shell.folder / "c.yaml").write_text(TIME + PLANT + right)
    assert list(told(shell, "simulate", "c.yaml")) == ["observers.B.gains", "runs.c.observers.A.gains"]
    with pytest.raises(ConfigError) as error:
        hgorun.simulate(hgorun.load(shell.folder / "c.yaml", run="c"))
    assert error.value.key == "runs.c.observers.A.gains"


def test_of_a_base_with_runs_whose_keys_a_sweep_varies(shell: Shell) -> None:
    """What an axis replaces is told with nothing else."""
    runs = (
        "observers: {A: {type: shgo, theta: 2}}\nruns: {b: {observers: {A: {theta: -1}}, measurement: {delay: -2}}}\n"
    )
    (shell.folder / "c.yaml").write_text(TIME + PLANT + runs)
    (shell.folder / "s.yaml").write_text("base: c.yaml\nrun: b\naxes: {observers.A.theta: [2, 3]}\n")
    assert list(told(shell, "sweep", "s.yaml")) == ["runs.b.measurement.delay"]
    (shell.folder / "s.yaml").write_text("base: c.yaml\nrun: b\naxes: {solver.step: [0.1, 0.05]}\n")
    assert list(told(shell, "sweep", "s.yaml")) == ["runs.b.measurement.delay", "runs.b.observers.A.theta"]
