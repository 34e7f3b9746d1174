"""Units for other simulators: FMPy reads them, and gets the numbers of the simulated run from them."""

from __future__ import annotations

import ctypes
import io
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from examples import CONTOIS, Block, experiment, inline
from exported_c import STRICT, Driven, compile_c, driven, load_all
from exported_fmu import GCC, Unit
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from shell import Shell

from hgorun.errors import HgorunError
from hgorun.export.fmu import Compiler, compilers, fmu
from hgorun.export.fmu_templates import VERSIONS, Version
from hgorun.export.prepared import Wanted, exported
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun

NOISE = [{"type": "gaussian", "std": 0.05}]
TWO = inline({"a": "b", "b": "-a + c", "c": "d", "d": "-c - a*b"}, ["a", "c"])
RUNS: dict[str, tuple[Block, Block, Block]] = {
    "late": (
        CONTOIS,
        {"type": "fhgo2", "theta": 2, "r": 1, "initial": {"x1": 1.2, "x2": 12}},
        {"sampling": {"period": 0.1}, "noise": NOISE, "delay": 0.15},
    ),
    "corrected": (
        TWO,
        {"type": "ekf", "Q": {"b": 0.1, "d": 0.1}},
        {"noise": NOISE, "outputs": {"a": {"sampling": {"period": 0.1}}, "c": {"sampling": {"period": 0.17}}}},
    ),
}


def before_samples(run: PreparedRun, found: Driven, folder: Path) -> np.ndarray:
    """What the exported C thinks at all events before their samples; after them, it thinks what the engine does."""
    one, rows = load_all(folder, exported(run))["O"], []
    for t, samples, theirs in zip(found.events, found.samples, found.estimates["O"], strict=True):
        one.predict(t)
        rows.append(one.estimate)
        for i, taken, y, _ in [] if one.observer.corrected else samples:
            one.update(taken, [y] * len(one.observer.outputs), 1 << i)
        if one.observer.corrected and samples:
            values = {i: y for i, _, y, _ in samples}
            one.update(t, [values.get(i, 0.0) for i in range(2)], sum(1 << i for i in values))
        np.testing.assert_allclose(one.estimate, theirs, rtol=0, atol=1e-11)
    return np.array(rows)


def run_of(name: str) -> PreparedRun:
    plant, block, measurement = RUNS[name]
    return prepare(experiment(plant, {"O": block}, measurement=measurement, step=0.01, end=3.0))


@pytest.mark.costly
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", RUNS)
def test_numbers(name: str, version: Version, tmp_path: Path) -> None:
    run = run_of(name)
    file = tmp_path / "O.fmu"
    file.write_bytes(fmu(exported(run)[0], version, GCC))
    assert validate_fmu(str(file)) == []
    found, unit = driven(run), Unit(file, version)
    own, expected = unit.follow(found, list(run.plant.model.outputs)), before_samples(run, found, tmp_path)
    np.testing.assert_allclose(own, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))
    state = unit.unit.getFMUState() if version == "3.0" else unit.unit.getFMUstate()
    unit.tell(y_a=1.0) if name == "corrected" else unit.tell(y_x1=1.0)
    before = unit.get([unit.number["time"]])
    unit.unit.doStep(8.0, 0.5)
    (unit.unit.setFMUState if version == "3.0" else unit.unit.setFMUstate)(state)
    assert unit.get([unit.number["time"]]) == before == [8.0]
    unit.unit.reset()
    assert unit.get([unit.number[v] for v in unit.number if v.startswith("xhat")]) == pytest.approx(expected[0])


@pytest.mark.costly
@pytest.mark.parametrize("version", VERSIONS)
def test_ages(version: Version, tmp_path: Path) -> None:
    """And one within it is not; one of later than now counts as now, and an age that is no number is an error."""
    (observer,) = exported(run_of("late"))
    content, found = fmu(observer, version, GCC[:1]), []
    for age in (None, 0.1, 2 * observer.pieces * observer.step, 0.0, -1e9):
        (tmp_path / f"{age}.fmu").write_bytes(content)
        unit = Unit(tmp_path / f"{age}.fmu", version)
        unit.tell(new_x1=0.0)
        unit.unit.doStep(5.0, 1.0)
        unit.tell(**({} if age is None else {"new_x1": 1.0, "y_x1": 2.0, "age_x1": age}))
        unit.unit.doStep(6.0, 0.5)
        found.append(unit.get([unit.number["xhat.x1"]]))
    assert found[2] == found[0] != found[1]
    assert found[4] == found[3] != found[0]
    for age in (np.nan, np.inf, -np.inf):
        unit.tell(new_x1=1.0, y_x1=2.0, age_x1=age)
        with pytest.raises(FMICallException):
            unit.unit.doStep(6.5, 0.5)
        assert unit.get([unit.number["time"]]) == [6.5]


LEFT_OUT = (1, "logStatusWarning", "left out: a sample older than one that was used, or than what is remembered")


@pytest.mark.costly
@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_left_out_is_told(version: Version, tmp_path: Path) -> None:
    """Ten times, unless the category is switched off; a step that ends in the past is told, too."""
    (observer,) = exported(run_of("late"))
    file = tmp_path / "O.fmu"
    file.write_bytes(fmu(observer, version, GCC[:1]))
    assert validate_fmu(str(file)) == []
    unit, old = Unit(file, version), 2 * observer.pieces * observer.step
    debug = unit.unit.fmi3SetDebugLogging if version == "3.0" else unit.unit.fmi2SetDebugLogging
    one = (ctypes.c_char_p * 1)(b"logStatusWarning")
    other = (ctypes.c_char_p * 1)(b"logStatusError")
    unit.tell(new_x1=0.0)
    unit.unit.doStep(5.0, 1.0)
    assert unit.said == []
    unit.tell(new_x1=1.0, y_x1=2.0, age_x1=old)
    for k, (on, count, names, told) in enumerate(
        [(True, 0, None, 1), (False, 1, one, 1), (False, 1, other, 1), (True, 1, one, 2), (False, 0, None, 2)]
    ):
        debug(unit.unit.component, on, count, names)
        unit.unit.doStep(6 + k / 10, 0.1)
        assert unit.said == told * [LEFT_OUT]
    debug(unit.unit.component, True, 0, None)
    for k in range(10):
        unit.unit.doStep(6.5 + k / 10, 0.1)
    assert unit.said == 7 * [LEFT_OUT] + [(1, "logStatusWarning", "further samples that are left out are not told")]
    unit.tell(new_x1=0.0)
    unit.unit.doStep(6.0, 0.1)
    assert unit.said[-1][2].startswith("the step ends before the time that has been reached")
    unit.tell(new_x1=1.0, age_x1=np.nan)
    with pytest.raises(FMICallException):
        unit.unit.doStep(7.5, 0.1)
    assert unit.said[-1] == (3, "logStatusError", "a time that goes back, or is none: nothing was done")


@pytest.mark.costly
def test_continuous_outputs_and_inputs(tmp_path: Path) -> None:
    """Held over a step: the same as a step that is told the same twice as often."""
    plant = inline({"a": "b", "b": "-a + u"}, "a", inputs={"u": "0"})
    run = prepare(experiment(plant, {"O": {"type": "shgo", "theta": 2}}, step=0.01, end=3.0))
    (observer,) = exported(run, Wanted(inputs_given=True))
    file = tmp_path / "O.fmu"
    file.write_bytes(fmu(observer, "3.0", GCC, single=True))
    unit = Unit(file, "3.0")
    for k in range(400):
        unit.tell(y_a=1.0, u_u=1.0)
        unit.unit.doStep(5 + k / 10, 0.1)
    assert unit.get([unit.number["xhat.a"], unit.number["xhat.b"]]) == pytest.approx([1.0, 0.0], abs=1e-5)


@pytest.mark.costly
def test_sources_compile_without_warnings(tmp_path: Path) -> None:
    (observer,) = exported(run_of("late"))
    strict = [Compiler(("gcc", *STRICT), "linux", "x86_64")]
    for version in VERSIONS:
        content = fmu(observer, version, strict)
        assert fmu(observer, version, []) == fmu(observer, version, [])
        names = zipfile.ZipFile(io.BytesIO(content)).namelist()
        folder = "linux64" if version == "2.0" else "x86_64-linux"
        assert f"binaries/{folder}/hgo_O.so" in names
        assert {"modelDescription.xml", "sources/O.c", "sources/O.h", "sources/O_fmi.c"} <= set(names)


@pytest.mark.parametrize("version", VERSIONS)
def test_an_observer_may_be_called_as_what_templates_have(version: Version, tmp_path: Path) -> None:
    """Its name stays as it is, in small and in capital letters."""
    observer = replace(exported(run_of("late"))[0], label="REAL ONE")
    parts = zipfile.ZipFile(io.BytesIO(fmu(observer, version, [])))
    names = [name for name in parts.namelist() if name.endswith((".c", ".h"))]
    files = {name.removeprefix("sources/"): parts.read(name).decode() for name in names}
    assert '#include "REAL_ONE.h"' in files["REAL_ONE_fmi.c"]
    compile_c(tmp_path, files, "-fsyntax-only")


def test_compilers(monkeypatch: pytest.MonkeyPatch) -> None:
    (observer,) = exported(run_of("late"))
    with pytest.raises(HgorunError, match="the C compiler fails: false"):
        fmu(observer, "3.0", [Compiler(("false",), "linux", "x86_64")])
    with pytest.raises(HgorunError, match="cannot be started"):
        fmu(observer, "3.0", [Compiler(("/no/such/cc",), "linux", "x86_64")])
    assert Compiler(("cc",), "linux", "aarch64").place("2.0", "x") is None
    monkeypatch.setenv("CC", "gcc -O1")
    assert [compiler.command for compiler in compilers()] == [("gcc", "-O1")]
    monkeypatch.setenv("CC", "no-such-compiler")
    assert compilers() == []
    monkeypatch.delenv("CC")
    monkeypatch.setattr("hgorun.export.fmu.find_spec", lambda name: name)
    assert [c.command[-1] for c in compilers()][:2] == ["x86_64-linux-gnu", "x86_64-windows-gnu"]


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    plant, block, measurement = RUNS["late"]
    (tmp_path / "tank.yaml").write_text(experiment(plant, {"O": block}, measurement=measurement, step=0.01).text)
    shell = Shell(tmp_path, monkeypatch, capsys)
    monkeypatch.setenv("CC", "gcc")
    code, out, err = shell("export", "tank.yaml", "--fmu", "--fmi", "2.0")
    assert (code, err) == (0, "")
    assert out.endswith("written: results/tank/O.fmu\n")
    monkeypatch.setenv("CC", "no-such-compiler")
    code, _, err = shell("export", "tank.yaml", "--fmu", "-q")
    assert code == 0
    assert "units have their sources only" in err
    for arguments, message in (
        (["--fmi", "1.0"], "expected one of 2.0, 3.0"),
        (["--lang", "latex"], "leave out --lang"),
    ):
        code, _, err = shell("export", "tank.yaml", "--fmu", *arguments)
        assert (code, message in err) == (2, True)


@pytest.mark.measured("2.0")
@pytest.mark.costly
@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_that_fails_says_why_to_the_simulator(tmp_path: Path, version: Version) -> None:
    """Its input stays 0, where the plant's logarithm has no value."""
    plant = inline({"a": "log(u) - a"}, ["a"], inputs={"u": "1.5"})
    run = prepare(experiment(plant, {"S": {"type": "shgo", "theta": 2}}, solver={"method": "rk4", "step": 0.01}))
    (observer,) = exported(run, Wanted(inputs_given=True))
    file = tmp_path / "S.fmu"
    file.write_bytes(fmu(observer, version, GCC[:1]))
    heard: list[tuple[Any, ...]] = []
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(file), stop_time=1.0, output_interval=0.1, logger=lambda *said: heard.append(said))
    assert [said[-1] for said in heard] == [
        b"a number that is none, or an estimate that is lost; inputs that are not given are 0"
    ]
    started = fmpy.simulate_fmu(
        str(file), start_values={"u.u": 1.5}, stop_time=1.0, logger=lambda *said: heard.append(said)
    )
    assert np.isfinite(started["xhat.a"]).all()
    assert len(heard) == 1
