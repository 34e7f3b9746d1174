"""What cannot be simulated, drawn or claimed is refused at its key, before anything runs."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from hgorun.cli import main
from hgorun.files import _MACHINE

BASE: dict[str, Any] = {
    "time": {"end": 1, "output_step": 0.1},
    "plant": {"states": ["x1", "x2"], "dynamics": {"x1": "x2", "x2": "-x1"}, "output": "x1"},
    "measurement": {"sampling": {"period": 0.25}},
    "observers": {"A": {"type": "shgo", "theta": 2}},
    "solver": {"step": 0.01},
}
BASE["plant"]["initial"] = {"x1": 1, "x2": 0}


def config(**changes: Any) -> dict[str, Any]:
    """The base with other values: double underscores stand for the dots of a path."""
    made: dict[str, Any] = json.loads(json.dumps(BASE))
    for path, value in changes.items():
        *keys, last = path.split("__")
        place = made
        for key in keys:
            place = place.setdefault(key, {})
        place[last] = value
    return made


def shell(
    folder: Path,
    given: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    *arguments: str,
) -> tuple[int, str, str]:
    monkeypatch.chdir(folder)
    (folder / "c.yaml").write_text(yaml.safe_dump(given, sort_keys=False))
    monkeypatch.setattr(sys, "argv", ["hgorun", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


def claim(value: str, **changes: Any) -> dict[str, Any]:
    return config(claims=[{"id": "a", "claim": "a sentence", "value": value, "below": 1}], **changes)


def varied(*values: float, path: str = "observers.A.theta", window: str = "") -> dict[str, Any]:
    vary = {"name": "k", "values": list(values), "set": {path: "k"}}
    return claim(f"exponent('v/A', x1{window})", runs={"v": {"vary": vary}})


def figure(**panel: Any) -> dict[str, Any]:
    return config(figures={"f": {"panels": [{"state": "x1", **panel}]}})


def noise(**item: Any) -> dict[str, Any]:
    return config(measurement__noise=[item])


BIOREACTOR = config(
    plant={"type": "bioreactor_gauthier", "initial": {"eta1": -1, "eta2": 1}, "inputs": {"u": 0.1}},
    observers={"A": {"type": "direct", "theta": 2}},
)


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "given", "where"),
    [
        ("simulate", config(time__output_step=5), "time.output_step: 5 is longer than the run"),
        ("simulate", config(metrics={"record": 5, "window": [0, 1]}, time__output_step=0.5), "metrics.record"),
        ("simulate", config(metrics={"window": [0.5, 600]}), "metrics.window: [0.5, 600] reaches outside"),
        ("simulate", config(metrics={"transient": [-5, -1]}), "metrics.transient"),
        ("simulate", config(time__start=1e13, time__end=1e13 + 1), "time.end"),
        ("simulate", config(time__start=-1e13, time__end=-1e13 + 1), "time.start"),
        ("simulate", config(time__start=1e16, time__end=1e16 + 100), "time.end"),
        ("simulate", BIOREACTOR, "plant.initial: the point (eta1 = -1, eta2 = 1) has no image"),
        ("simulate", config(measurement__sampling={"period": 0.25, "offset": 5}), "sampling.offset: no sample"),
        ("simulate", config(measurement__sampling={"period": 0.25, "dropout": 1}), "measurement.sampling: no sample"),
        ("simulate", config(measurement__sampling={"times": [7]}), "measurement.sampling.times: no sample"),
        (
            "simulate",
            config(plant__output="sqrt(x1 - 0.6)", observers={}),
            "output y1 is not a finite number at t = 1",
        ),
        ("simulate", noise(type="gaussian", snr_db=3100), "measurement.noise.0.snr_db"),
        ("simulate", noise(type="gaussian", snr_db=-3100), "measurement.noise.0.snr_db"),
        ("simulate", noise(type="uniform", low=-1e308, high=1e308), "high - low is not finite"),
        ("claims", claim("rmse('A', x1, 5, 9)"), "claims.0.value: rmse('c/A', x1, 5.0, 9.0): run c lasts from 0 to 1"),
        ("claims", claim("rmse('A', x1, 0.51, 0.52)"), "claims.0.value"),
        ("claims", claim("largest('c', x1, -1, 0)"), "claims.0.value"),
        ("claims", claim("exponent('A', x1)"), "an exponent needs a run with vary"),
        ("claims", varied(2, 2), "at least two different values > 0 of k"),
        ("claims", varied(2, 3, window=", 10, 20"), "at least two different values > 0 of k"),
        ("claims", varied(2, 3, path="observers.A.thetta"), "runs.v.vary.set.observers.A.thetta: unknown key"),
        ("claims", varied(2, 3, path="observers..theta"), "runs.v.vary.set.observers..theta"),
        ("claims", varied(2, 3, -3), "runs.v.vary.set.observers.A.theta: expected a number above 0"),
        ("figures", figure(observers=[]), "figures.f.panels.0.observers: an empty list"),
        ("figures", figure(limits=[-1e308, 1e308]), "figures.f.panels.0.limits: expected numbers up to 1e+100"),
        ("figures", figure(window=[-1e308, 1e308]), "figures.f.panels.0.window"),
        ("figures", figure(inset={"window": [0, 1], "limits": [-1e308, 1]}), "figures.f.panels.0.inset.limits"),
        (
            "figures",
            config(figures={"f": {"width": 100, "height": 100, "panels": [{"state": "x1"}]}}),
            "figures.f: 100 x 100 inches",
        ),
    ],
)
def test_it_is_refused(
    command: str,
    given: dict[str, Any],
    where: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = shell(tmp_path, given, monkeypatch, capsys, command, "c.yaml")
    assert (code, out) == (2, "")
    assert err.startswith("hgorun: c.yaml:")
    assert where in err
    assert err.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["c.yaml"]


def test_all_runs_are_checked_before_the_first_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    later = {"measurement": {"noise": [{"type": "expression", "value": "1/(t - 0.5)"}]}}
    given = config(runs={"a": {}, "b": later})
    code, _, err = shell(tmp_path, given, monkeypatch, capsys, "simulate", "c.yaml")
    assert code == 2
    assert "measurement.noise: the noise is not a finite number at t = 0.5" in err
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("start", [1.7e9, -1.7e9])
def test_a_clock_that_started_long_ago(
    start: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = config(time__start=start, time__end=start + 1)
    assert shell(tmp_path, given, monkeypatch, capsys, "simulate", "c.yaml", "-q")[0] == 0


@pytest.mark.parametrize("label", ["[7] HGO", "[", "a[0]", "()", "x y", "θ=2"])
def test_a_label_is_only_a_label(
    label: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = config(observers={label: {"type": "shgo", "theta": 2, "saturation": {"x2": [-9, 9]}}})
    code, out, _ = shell(tmp_path, given, monkeypatch, capsys, "simulate", "c.yaml", "--json")
    assert code == 0
    assert list(json.loads(out)["observers"]) == [label]


def test_json_of_several_runs_is_a_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = config(runs={"a": {"observers": {"A": {"theta": 3}}}, "b": {}})
    code, out, _ = shell(tmp_path, given, monkeypatch, capsys, "compare", "c.yaml", "--json", "--no-plots")
    assert code == 0
    assert [(found["name"], found["file"]) for found in json.loads(out)] == [("a", "c.yaml"), ("b", "c.yaml")]


@pytest.mark.costly
def test_a_legend_may_name_an_observer_of_a_run_that_is_not_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = {"a": {}, "b": {"observers": {"B": {"type": "shgo", "theta": 3}}}}
    figures = {"f": {"labels": {"B": "second", "b/B": "b"}, "panels": [{"state": "x1", "run": "a"}]}}
    code, _, err = shell(tmp_path, config(runs=runs, figures=figures), monkeypatch, capsys, "figures", "c.yaml")
    assert (code, err) == (0, "")


def test_json_of_figures_says_inf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = config(
        figures={"f": {"panels": [{"state": "x1"}]}}, observers__A__theta=50, time__end=10, time__output_step=1
    )
    code, out, err = shell(tmp_path, given, monkeypatch, capsys, "figures", "c.yaml", "--json")
    assert code == 0
    assert "diverged" in err
    error = json.loads(out)[0]["integration_error"]
    assert error == "inf" or math.isfinite(error)


def test_a_plant_that_diverges_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = config(plant__dynamics__x2="x1 + 9*x1**3", time__end=60)
    code, _, err = shell(tmp_path, given, monkeypatch, capsys, "simulate", "c.yaml")
    assert code == 1
    assert "hgorun: c.yaml:4: plant: the plant itself diverged at t = " in err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("simulate", "c.yaml", "-o", "out.csv"), "compare --format csv"),
        (("simulate", "c.yaml", "-o", "out.png"), "expected a file .h5, .hdf5, .nc or a folder, found out.png"),
        (("compare", "c.yaml", "-o", "out.csv"), "compare --format csv"),
        (("compare", "c.yaml", "-o", "out.tex"), "compare --format latex"),
        (("compare", "c.yaml", "-o", "c.yaml"), "expected a file .pdf, .png or a folder"),
        (("analyze", "c.yaml", "-o", "out.json"), "--output"),
        (("figures", "c.yaml", "-o", "out.pdf"), "--output: expected a folder"),
        (("claims", "c.yaml", "-o", "c.yaml"), "--output: expected a folder"),
        (("simulate", "contois_te025.yaml"), "`hgorun init contois_te025` copies"),
        (("analyze", "contois_te025.yml"), "`hgorun init contois_te025` copies"),
        (("show", "qwerty"), "nothing is called 'qwerty'. See hgorun list"),
    ],
)
def test_a_wrong_argument_is_explained(
    arguments: tuple[str, ...],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = shell(tmp_path, BASE, monkeypatch, capsys, *arguments)
    assert (code, out) == (2, "")
    assert says in err
    assert [p.name for p in tmp_path.iterdir()] == ["c.yaml"]


def test_what_a_killed_process_left_is_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    left = tmp_path / "results" / f".c.h5-{_MACHINE}-{2**22 + 1}-abcdef.part"  # beyond the largest number of a process
    left.parent.mkdir()
    left.write_bytes(b"half a file")
    assert shell(tmp_path, BASE, monkeypatch, capsys, "simulate", "c.yaml", "-q")[0] == 0
    assert [p.name for p in left.parent.iterdir()] == ["c.h5"]
