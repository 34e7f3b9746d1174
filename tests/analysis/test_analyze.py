"""The command, its JSON and its figure, and analyses of every family of observers."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import said

import hgorun
from hgorun import Experiment
from hgorun.analysis.finding import Finding, all_findings
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.report import Analysis, analysis_of
from hgorun.analysis.search import smallest
from hgorun.analysis.subject import Subject
from hgorun.cli import main
from hgorun.commands.analyze import _target
from hgorun.figures.peaking import peaking
from hgorun.files import json_value
from hgorun.tables import analysis as table

PAPERS = {"lee", "meiners", "katayama"}
CONFIG = """
title: Van der Pol
time: {end: 3, output_step: 0.01, unit: h}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}
observers:
  SHGO: {type: shgo, theta: 40}
  slow: {type: fhgo2, theta: 2, r: 1}
  gain: {type: shgo_riccati, theta: 8}
solver: {step: 1.0e-3}
"""
# what every observer has in JSON
OF_FILTERS = {"stationary_poles", "stationary_gain", "stationary_error"}  # of no other observers
KEYS = [f.name for f in all_findings() if "json" in f.places and not f.optional and f.name not in PAPERS | OF_FILTERS]
Shell = Callable[..., tuple[int, str, str]]


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "vdp.yaml").write_text(CONFIG)
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["hgorun", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return run


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    path = tmp_path_factory.mktemp("analysis") / "vdp.yaml"
    path.write_text(CONFIG)
    return hgorun.analyze(hgorun.load(path))


@pytest.mark.measured
@pytest.mark.slow
def test_table_and_figure(shell: Shell) -> None:
    code, out, err = shell("analyze", "vdp.yaml", "-v")
    assert (code, err) == (0, "")
    assert "theta_bound" in out
    assert "-1 (2)" in out
    assert max(map(len, out.splitlines())) <= 100
    assert Path("results/vdp-analysis.png").read_bytes().startswith(b"\x89PNG")
    assert Path("results/vdp-analysis.pdf").exists()
    assert "written: results/vdp-analysis.png, results/vdp-analysis.pdf" in out


@pytest.mark.slow
def test_json_and_nothing_else(shell: Shell) -> None:
    code, out, err = shell("analyze", "vdp.yaml", "--json", "-o", "there")
    assert (code, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert list(found) == ["name", "file", "units", "observers", "figures"]
    assert (found["name"], found["file"]) == ("vdp", "vdp.yaml")
    assert all(Path(figure).exists() for figure in found["figures"])
    assert "there/vdp-analysis.png" in found["figures"]
    assert Path("there/vdp-analysis.png").exists()
    assert not Path("results").exists()
    shgo = found["observers"]["SHGO"]
    assert shgo["poles"] == [[-1, 0], [-1, 0]]
    assert shgo["hurwitz"] is True
    assert shgo["beta"] == pytest.approx(0.1464466)
    assert set(shgo["peaking"]) == {"x1", "x2"}
    assert shgo["peaking_bound"]["x2"] > shgo["peaking"]["x2"]
    assert shgo["theta_bound"] < 40
    for observer in found["observers"].values():
        assert set(KEYS) <= set(observer)
        for key in [k for k, value in observer.items() if value is None]:
            assert observer["reasons"][key], key
        for key in observer["reasons"]:
            assert observer[key] is None
    assert "below theta_bound" in found["observers"]["slow"]["reasons"]["peaking_bound"]


@pytest.mark.slow
def test_options(shell: Shell) -> None:
    assert shell("analyze", "vdp.yaml", "--quiet", "--no-plots") == (0, "", "")
    assert not Path("results").exists()
    code, out, _ = shell("analyze", "vdp.yaml", "--json", "--no-plots", "--set", "observers.SHGO.theta=3")
    assert code == 0
    assert json.loads(out)["observers"]["SHGO"]["theta"] == 3
    assert shell("analyze", "vdp.yaml", "--quiet", "-o", "one.png")[0] == 0
    assert Path("one.png").exists()
    assert not Path("one.pdf").exists()


@pytest.mark.costly
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.yaml"], "nowhere.yaml"),
        (["vdp.yaml", "--set", "observers.SHGO.thetta=1"], "theta"),
        (["vdp.yaml", "--set", "observers.SHGO.theta=-1"], "theta"),
        (["result.h5"], "there is no such file"),
        (["vdp.yaml", "-o", "vdp.yaml"], "or a folder"),
    ],
)
def test_wrong_input(shell: Shell, arguments: list[str], words: str) -> None:
    code, out, err = shell("analyze", *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert "Traceback" not in err
    assert not Path("results").exists()


def test_a_plant_that_diverges_is_not_analysed(shell: Shell) -> None:
    Path("vdp.yaml").write_text(CONFIG.replace("type: van_der_pol", "type: integrator_chain, phi: x2**3"))
    code, out, err = shell("analyze", "vdp.yaml")
    assert (code, out) == (1, "")
    assert "diverged" in err


@pytest.mark.slow
def test_an_observer_that_diverges_is_a_finding(shell: Shell) -> None:
    late = ["--set", "measurement.sampling.period=0.5", "--set", "solver.divergence=10"]
    code, out, err = shell("analyze", "vdp.yaml", "--json", *late)
    assert code == 0
    assert "SHGO diverged" in err
    found = json.loads(out)["observers"]["SHGO"]
    assert "the observer diverged" in found["reasons"]["peaking_bound"]


@pytest.mark.measured
@pytest.mark.slow
def test_search(shell: Shell) -> None:
    """x_2' = 0.8 x_2 grows: the smallest theta lies far below the bound."""
    Path("vdp.yaml").write_text(CONFIG.replace("type: van_der_pol", "type: integrator_chain, phi: 0.8*x2"))
    code, out, _ = shell("analyze", "vdp.yaml", "--json", "--no-plots", "--search")
    assert code == 0
    found = json.loads(out)["observers"]
    assert 0.8 < found["SHGO"]["theta_critical"] < found["SHGO"]["theta_bound"]


@pytest.mark.parametrize(("limit", "start"), [(3.0, 100.0), (3.0, 0.1), (0.2, 1.0)])
def test_the_search_finds_a_border(limit: float, start: float) -> None:
    found = smallest(lambda theta: theta > limit, start)
    assert isinstance(found, float)
    assert limit < found <= 1.03 * limit


def test_a_search_without_a_border_says_so() -> None:
    with pytest.raises(NoValue, match="by itself"):
        smallest(lambda theta: True, 1.0)
    with pytest.raises(NoValue, match="any theta"):
        smallest(lambda theta: False, 1.0)


@pytest.mark.slow
@pytest.mark.measured
def test_compare_has_what_is_predicted(shell: Shell) -> None:
    code, out, _ = shell("compare", "--analyze", "--no-plots", "vdp.yaml")
    assert code == 0
    assert "beta theta" in out
    code, out, _ = shell("compare", "--analyze", "--no-plots", "--json", "vdp.yaml")
    found = json.loads(out)["observers"]["SHGO"]
    assert found["predicted"]["beta theta"] == pytest.approx(40 * 0.1464466)
    assert found["predicted"]["delay_bound"] > 0
    assert "predicted" not in json.loads(shell("compare", "--no-plots", "--json", "vdp.yaml")[1])["observers"]["SHGO"]
    code, out, _ = shell("compare", "--analyze", "--no-plots", "--format", "csv", "vdp.yaml")
    assert any(line.split(",")[3:5] == ["", "delay_bound"] for line in out.splitlines())
    code, _, err = shell("compare", "--analyze", "--no-plots", "--format", "latex", "vdp.yaml")
    assert code == 2
    assert "--analyze" in err
    shell("simulate", "vdp.yaml", "--quiet")
    code, out, _ = shell("compare", "--analyze", "--no-plots", "results/vdp.h5", "vdp.yaml")
    assert code == 0
    assert "beta theta" in out


@pytest.mark.slow
def test_the_figure_draws_bounds_where_they_hold(analysis: Analysis) -> None:
    figure = peaking(analysis.result, analysis.transients)
    assert [ax.get_yscale() for ax in figure.axes] == ["log", "log"]
    labels = [str(line.get_label()) for line in figure.axes[0].lines]
    assert labels == ["SHGO", "_SHGO: bound", "slow", "_slow: decay of the theorem", "gain"]
    beside = [text.get_text() for text in figure.legends[0].get_texts()][-2:]
    assert beside == [
        "bound of the theorem",
        "no bound of this run: that of an ideal one, without noise, delay and disturbance",
    ]
    error, bound = figure.axes[1].lines[:2]
    assert np.max(error.get_ydata()) < np.max(bound.get_ydata())


@pytest.mark.costly
def test_the_table_takes_what_is_declared(analysis: Analysis) -> None:
    given: dict[str, Any] = {"noise": {"x1": 0.125, "x2": 2.5}, "anything": 42.0, "nothing": math.inf}
    extra = tuple(Finding(name=name, meaning="", of=lambda _: 0.0, group=name, title=name) for name in given)
    found = replace(analysis.observers["SHGO"], values={**analysis.observers["SHGO"].values, **given})
    both = {**analysis.observers, "SHGO": found}
    text = table.text(replace(analysis, findings=(*analysis.findings, *extra), observers=both))
    assert "noise x2" in text
    assert "anything" in text
    assert "inf" in text
    assert max(map(len, text.splitlines())) <= 100


def test_a_reason_is_caught_once_and_named(analysis: Analysis) -> None:
    def refuse(observer: Subject) -> float:
        raise NoValue(f"not for {observer.label}")

    asked = [
        Finding(name="refused", meaning="", of=refuse),
        Finding(name="silent", meaning="", of=refuse, optional=True),
        Finding(name="of_one", meaning="", of=lambda _: 1.0, applies=lambda observer: observer.label == "slow"),
    ]
    context = analysis.context
    made = analysis_of(context.run, context.result, asked).observers
    assert made["SHGO"].values == {"refused": None}
    assert made["SHGO"].reasons == {"refused": "not for SHGO"}
    assert made["slow"].values == {"refused": None, "of_one": 1.0}


def test_values_as_json_holds_them() -> None:
    made = json_value(
        {"a": np.array([1 + 2j]), "b": math.inf, "c": np.float64("nan"), "d": np.bool_(True), "e": (1, None)}
    )
    assert made == {"a": [[1, 2]], "b": "inf", "c": "nan", "d": True, "e": [1, None]}


START = {"eta1": 0.05, "eta2": "0.05*0.01/(3*0.05 - 0.01)"}
BIOREACTOR = {"type": "bioreactor_gauthier", "inputs": {"u": "0.08"}, "initial": {"eta1": 0.05, "eta2": 0.05}}
DYNAMIC = {"l": [2, 1], "a": 1.17, "b": 2.3, "q": 0.15, "gamma": "4*y", "initial": START}
QUBE = {
    "type": "qube_pendulum",
    "inputs": {"V": "sin(t)"},
    "initial": {"theta": 0, "alpha": 3.0, "theta_dot": 0, "alpha_dot": 0},
}
EVERYTHING: dict[str, dict[str, Any]] = {
    "Meiners": {
        "plant": BIOREACTOR,
        "observers": {
            "direct": {"type": "direct", "theta": 1, "l": [1, 0.5], "initial": START},
            "dynamic": {"type": "dynamic_gain", **DYNAMIC},
            "levant": {"type": "levant", "G": 1, "initial": {"eta1": 0.05, "eta2": 0}},
        },
        "solver": {"method": "euler", "step": 5e-5},
        "time": {"end": 0.1, "output_step": 0.01},
    },
    "Katayama": {
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}},
        "measurement": {"sampling": {"period": 0.1}},
        "observers": {"reduced": {"type": "reduced_sampled", "H": 0.5}, "deadbeat": {"type": "deadbeat"}},
    },
    "Lee": {
        "plant": {"type": "lee_second_order", "initial": {"x1": 10, "x2": 10}, "discretise": "euler"},
        "measurement": {"sampling": {"period": 4e-4}, "noise": [{"type": "gaussian", "std": 0.1}]},
        "observers": {"fixed": {"type": "hgo_fd", "eps": 0.01, "gains": [2, 2]}},
    },
    "two outputs": {
        "plant": QUBE,
        "measurement": {"noise": [{"type": "uniform", "low": -0.1, "high": 0.1, "hold": 0.1}], "delay": "0.01*t"},
        "observers": {
            "SHGO": {"type": "shgo", "theta": 5, "initial": {"alpha": 3}},
            "FHGO": {"type": "fhgo2", "r": 1, "theta": 5, "initial": {"alpha": 3}},
            "FHGO I": {"type": "fhgo1", "theta": 5, "delta": 3, "initial": {"alpha": 3}},
            "Riccati": {"type": "shgo_riccati", "theta": 5, "initial": {"alpha": 3}},
        },
    },
    "academic": {
        "plant": {"type": "academic", "initial": {"x1": 1, "x2": 1, "x3": 1}, "disturbance": {"x3": "0.1*sin(0.1*t)"}},
        "measurement": {"sampling": {"period": 0.02, "offset": 0.01}, "mode": "multiplicative",
                        "noise": [{"type": "expression", "value": "0.1*sin(k)"}]},
        "observers": {
            "FHGO I": {"type": "fhgo1", "theta": 5, "delta": 3},
            "FHGO II": {"type": "fhgo2_nuos", "theta": 5, "r": 2},
        },
    },
    "one state": {
        "plant": {"type": "integrator_chain", "n": 1, "phi": "-x1", "initial": {"x1": 1}},
        "observers": {"SHGO": {"type": "shgo", "theta": 5}, "FHGO": {"type": "fhgo2", "r": 2, "theta": 5}},
    },
    "coordinates": {
        "plant": {"type": "contois", "inputs": {"D": "mu*(1 - abs(sin(t))/2)"}, "initial": {"x1": 1.5, "x2": 15},
                  "disturbance": {"x1": "0.01*sin(t)"}},
        "observers": {
            "x": {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": 14}, "saturation": {"x2": [0, 14.5]}},
            "z": {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": 14}, "coordinates": "canonical"},
        },
    },
}  # fmt: skip


@pytest.mark.measured("Meiners", "Lee", "coordinates")
@pytest.mark.slow
@pytest.mark.parametrize("name", EVERYTHING)
def test_every_family_is_analysed(name: str) -> None:
    """Numbers or reasons, and never a failure."""
    made = hgorun.analyze(Experiment({"time": {"end": 1, "output_step": 0.01}, **EVERYTHING[name]}))
    found = json.loads(json.dumps(made.as_json(), allow_nan=False))["observers"]
    assert set(found) == set(EVERYTHING[name]["observers"])
    for observer in found.values():
        for key in KEYS:
            assert observer[key] is not None or observer["reasons"][key], key
    assert max(map(len, table.text(made).splitlines())) <= 100


@pytest.mark.costly
def test_equal_observers_in_x_and_z_have_equal_transients() -> None:
    config = json.loads(json.dumps(EVERYTHING["coordinates"]))
    del config["observers"]["x"]["saturation"]
    made = hgorun.analyze(Experiment({"time": {"end": 1, "output_step": 0.01}, **config}))
    one, other = (made.transients[label] for label in ("x", "z"))
    assert np.allclose(one.error, other.error, atol=1e-6)
    assert np.allclose(one.bound, other.bound, rtol=1e-3)
    assert one.names == ("z1", "z2")


def test_a_gain_that_is_not_hurwitz_has_no_bounds() -> None:
    config = {
        "time": {"end": 1, "output_step": 0.01},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}},
        "observers": {"SHGO": {"type": "shgo", "theta": 1, "gains": [1, -2]}},
    }
    made = hgorun.analyze(Experiment(config))
    found = made.observers["SHGO"]
    assert said(found)["hurwitz"] is False
    assert np.allclose(said(found)["poles"], [-2, 1])
    assert said(found)["beta"] is None
    assert "not Hurwitz" in found.reasons["theta_bound"]
    assert said(found)["peaking"]["x1"] >= 1
    assert not made.transients["SHGO"].holds


@pytest.mark.measured
@pytest.mark.slow
def test_before_the_first_sample_nothing_is_promised() -> None:
    made = hgorun.analyze(Experiment({"time": {"end": 1, "output_step": 0.01}, **EVERYTHING["academic"]}))
    found = made.observers["FHGO II"]
    assert said(found)["delay_max"] == math.inf
    assert said(found)["eta_theta"] is None


def test_figures_stand_where_a_file_or_a_folder_says() -> None:
    assert _target("a", Path("b.png")) == Path("b")
    assert _target("a", Path("folder")) == Path("folder/a-analysis")
