"""``hgorun rerun``: the same bits again, here and with another instruction set, and what is said where they are not."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import yaml
from numpy._core._multiarray_umath import (  # type: ignore[import-not-found]  # not public
    __cpu_dispatch__,
    __cpu_features__,
)

import hgorun
from hgorun.commands.rerun import rerun
from hgorun.commands.run_options import Rerun
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError

# where all that a library has a part in decides a number: poles, roots, P(0), the automatic step, sines, draws, kinks
EVERYTHING = """
title: all that could differ
seed: 4
time: {end: 3, output_step: 0.05}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: "-sin(x1) - 0.3*tanh(x2) + u*exp(-0.1*t)"}
  output: {y: x1 + 0.1*sin(x1)}
  inputs: {u: "where(sin(3.3*t + exp(0.3)) > 0.2, 2**0.7, -cos(log(2)*t))"}
  initial: {x1: 0.7*sqrt(2), x2: sin(0.4)}
measurement:
  phases:
    - {until: 1.4, sampling: {period: 0.11, jitter: 0.02, dropout: 0.1}, delay: 0.05 + 0.01*sin(t)**2,
       noise: [{type: gaussian, snr_db: 31.7}, {type: sinusoids, terms: [{amplitude: 0.01, omega: 40}]}]}
    - {until: 3, delay: 0.06 + 0.02*cos(2*t), noise: [{type: expression, value: "0.01*max(sin(9*t), 0.3*cos(31*t))"},
       {type: uniform, low: -0.02, high: 0.01, hold: 0.07}, {type: gaussian, std: 0.01, hold: 0.13}]}
observers:
  SHGO: {type: shgo, theta: exp(0.9), poles: [-1+0.3j, -1-0.3j]}
  FHGO: {type: fhgo2, theta: 2, r: 2}
  Integral: {type: integral, theta: 1.5}
"""

# every one of these changes the last bits of the functions of a library on a machine that has more
OTHER = {
    "HGORUN_CPU": "x86-64",
    "NPY_DISABLE_CPU_FEATURES": " ".join(name for name in __cpu_dispatch__ if __cpu_features__[name]),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX,-FMA,-FMA4",
    "OPENBLAS_CORETYPE": "Prescott",
}


def command(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hgorun", *arguments],
        capture_output=True, text=True, cwd=folder, env={**os.environ, **environment},
    )  # fmt: skip


def told(capsys: pytest.CaptureFixture[str], file: Path, **options: Any) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON."""
    code = rerun(Rerun(file=file, json=True, **options))
    return code, json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rerun") / "everything.yaml"
    path.write_text(EVERYTHING)
    return path


@pytest.fixture(scope="module")
def result(config: Path) -> hgorun.Result:
    return hgorun.simulate(hgorun.load(config))


@pytest.fixture
def file(result: hgorun.Result, tmp_path: Path) -> Path:
    return result.save(tmp_path / "everything.h5")


@pytest.mark.slow
def test_a_result_is_made_again(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = told(capsys, file)
    assert (code, out["same"]) == (0, True)
    again = file.with_name("everything.rerun.h5")
    with h5py.File(file) as one, h5py.File(again) as other:
        assert {k: v for k, v in one.attrs.items() if k != "created"} == {
            k: v for k, v in other.attrs.items() if k != "created"
        }
        found = {row["path"]: row for row in out["datasets"]}
        assert found["observers/SHGO/xhat"]["stored"] == other["observers/SHGO/xhat"].attrs["sha256"]
        paths: list[str] = []
        one.visititems(lambda name, thing: paths.append(name) if isinstance(thing, h5py.Dataset) else None)
        assert sorted(paths) == sorted(found)


@pytest.mark.costly
def test_a_check_writes_nothing(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert rerun(Rerun(file=file, check=True)) == 0
    assert capsys.readouterr().out.startswith("the same: ")
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.measured
@pytest.mark.slow
def test_what_is_not_the_same_is_named(
    result: hgorun.Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    x = result.x.copy()
    x[7, 0] = np.nextafter(x[7, 0], 9)
    file = replace(result, x=x).save(tmp_path / "other.h5")
    code, out = told(capsys, file, check=True)
    assert (code, out["same"]) == (3, False)
    assert [row["path"] for row in out["datasets"] if row["stored"] != row["found"]] == ["plant/x"]
    assert rerun(Rerun(file=file, check=True)) == 3
    assert capsys.readouterr().out == "different: plant/x\n"
    assert rerun(Rerun(file=file, output=tmp_path / "new.h5", quiet=True)) == 0
    assert hgorun.read(tmp_path / "new.h5").x[7, 0] == result.x[7, 0]


@pytest.mark.costly
def test_the_numbers_of_the_design_are_those_of_the_file(
    result: hgorun.Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Gains, P(0) and the automatic step come from libraries: another machine's are taken as they are."""
    assert result.design is not None
    parameters = result.design.parameters.copy()
    parameters[-3:] *= 1 + 1e-15
    design = replace(result.design, parameters=parameters, step=0.5 * result.design.step)
    file = replace(result, design=design).save(tmp_path / "design.h5")
    _, out = told(capsys, file, check=True)
    different = {row["path"] for row in out["datasets"] if row["stored"] != row["found"]}
    assert {"plant/x", "observers/FHGO/xhat"} <= different
    assert not different & {"design/parameters", "design/start"}


def test_numbers_that_do_not_fit_are_refused(result: hgorun.Result, tmp_path: Path) -> None:
    assert result.design is not None
    design = replace(result.design, start=result.design.start[1:])
    file = replace(result, design=design).save(tmp_path / "short.h5")
    with pytest.raises(ConfigError, match="not as many"):
        rerun(Rerun(file=file))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f["design"].attrs.modify("step", np.nan), "attribute step must be a positive number"),
        (lambda f: f["design"].attrs.modify("step", -1.0), "attribute step must be a positive number"),
        (lambda f: f["design"].attrs.__delitem__("step"), "attribute step must be a positive number"),
        (lambda f: f.__delitem__("design/start"), "design/start is missing"),
        (lambda f: (f.__delitem__("design"), f.__setitem__("design", 1.0)), "design is not a group"),
        (lambda f: (f.__delitem__("design"), f.__setitem__("design", h5py.SoftLink("/design"))), "which is refused"),
        (lambda f: f.attrs.modify("config_resolved", "extends: other.yaml"), "damaged"),
        (
            lambda f: (f.attrs.modify("config_resolved", "extends: a.yaml"), f.attrs.__delitem__("sha256")),
            "config_resolved:1",
        ),
        (lambda f: (f.attrs.modify("config_resolved", "x: ["), f.attrs.__delitem__("sha256")), "config_resolved:1"),
    ],
)
@pytest.mark.measured(
    "<lambda>-attribute step must be a positive number1", "<lambda>-design is not a group", "<lambda>-damaged"
)
def test_files_that_are_not_sound_are_refused(change: Callable[[h5py.File], object], message: str, file: Path) -> None:
    with h5py.File(file, "r+") as f:
        change(f)
    with pytest.raises(ConfigError, match=message):
        rerun(Rerun(file=file, check=True, quiet=True))


def test_a_file_without_digests_is_refused(file: Path) -> None:
    with h5py.File(file, "r+") as f:
        f.visititems(lambda _, thing: thing.attrs.pop("sha256", None) and None)
        del f.attrs["sha256"]
    with pytest.raises(ConfigError, match=r"everything\.h5: its data sets have no attribute sha256"):
        rerun(Rerun(file=file, check=True))


@pytest.mark.slow
def test_the_resolved_configuration_is_the_same_again(file: Path, result: hgorun.Result) -> None:
    rerun(Rerun(file=file, quiet=True))
    again = hgorun.read(file.with_name("everything.rerun.h5"))
    assert yaml.safe_load(again.config_resolved) == yaml.safe_load(result.config_resolved)
    assert (again.name, again.title, again.config) == (result.name, result.title, result.config)


@pytest.mark.unmeasured
@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of this family")
def test_another_instruction_set_makes_the_same_bits(config: Path, file: Path, tmp_path: Path) -> None:
    """Compiled for SSE2, with a NumPy, a C library and a BLAS that use nothing newer: no number of a file differs."""
    shipped = Path(__file__).parents[2] / "experiments/robles2023/chapter3/contois_te025.yaml"
    here = hgorun.simulate(hgorun.load(shipped)).save(tmp_path / "contois.h5")
    for made in (file, here):
        checked = command(tmp_path, "rerun", str(made), "--check", "-q", **OTHER)
        assert (checked.returncode, checked.stderr) == (0, ""), checked.stdout
    there = command(tmp_path, "simulate", str(config), "-q", **OTHER)
    assert (there.returncode, there.stderr) == (0, "")
    assert command(tmp_path, "rerun", "results/everything.h5", "--check").returncode == 0
    with h5py.File(tmp_path / "results/everything.h5") as f:
        assert f.attrs["processor"].endswith(" x86-64")


def test_the_other_instruction_set_is_another_one() -> None:
    """Else the test above would prove nothing: its settings change the bits of libraries, where there is a choice."""
    if not OTHER["NPY_DISABLE_CPU_FEATURES"] or platform.libc_ver()[0] != "glibc":
        pytest.skip("this machine has no more than the other one")
    code = (
        "import numpy as np, hashlib; x = np.random.default_rng(0).uniform(-3, 3, 100_000);"
        "print(hashlib.sha256(np.sin(x).tobytes()).hexdigest())"
    )
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, env={**os.environ, **more}).stdout
        for more in ({}, OTHER)
    ]
    assert runs[0] != runs[1]


@pytest.mark.slow
def test_resolved_configurations_are_configurations() -> None:
    """Of every experiment that is shipped, with the same meaning."""
    for path in sorted((Path(__file__).parents[2] / "experiments").rglob("*.yaml")):
        if path.name.startswith("_") or path.name == "benchmark.yaml":
            continue
        for run in hgorun.load_study(path).runs.values():
            member = next(iter(run.members()))
            resolved = member.resolved_text
            assert hgorun.Experiment(parse(resolved, "resolved")).resolved_text == resolved
