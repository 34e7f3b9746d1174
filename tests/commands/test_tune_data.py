"""``hgorun tune`` on recordings: several of them, parameters of the plant, all outputs."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from shell import Shell

from hgorun.commands import tune_data
from hgorun.errors import Problem
from hgorun.estimate.gains.goal import Goal, read_goal

CONFIG = """
plant:
  states: [a, b]
  parameters: {k: 1, d: 0, unused: 1}
  dynamics: {a: b, b: -k*a - d*b}
  output: [a, b]
  inputs: {w: unused}
solver: {step: 0.02}
data:
  file: one.csv
  time: t
  period: 0.2
  first_samples: 2
  outputs: {a: {column: a, std: 0.01}, b: {column: b, std: 0.02}}
observers:
  o: {type: shgo, theta: 2, poles: -1}
  p: {type: ekf, Q: {b: 1}, R: 0.01}
tune:
  gains:
    plant.parameters.k: {log: [1, 9]}
    plant.parameters.d: {linear: [-1, 1]}
    observers.o.theta: {log: [0.3, 8]}
  minimise: holdout_rmse(o, *)
  budget: 40
  seeds: 1
"""


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """Two recordings of a'' = -4 a."""
    t = 0.05 * np.arange(121)
    for name, size, phase in (("one", 1.0, 0.0), ("two", 0.4, 2.0)):
        a, b = size * np.cos(2 * t + phase), -2 * size * np.sin(2 * t + phase)
        rows = [",".join(map("{:.6f}".format, row)) for row in zip(t, a, b, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,a,b", *rows]) + "\n")
    (tmp_path / "tuned.yaml").write_text(CONFIG)
    return Shell(tmp_path, monkeypatch, capsys)


def changed(shell: Shell, path: str, value: object) -> None:
    """The configuration with another key of ``tune``."""
    config = yaml.safe_load((shell.folder / "tuned.yaml").read_text())
    config["tune"][path] = value
    (shell.folder / "tuned.yaml").write_text(yaml.safe_dump(config))


@pytest.mark.slow
@pytest.mark.parametrize("logs", [[], ["one.csv", "two.csv"]])
def test_the_model_is_found_with_the_gain(shell: Shell, logs: list[str]) -> None:
    code, out, _ = shell("tune", "tuned.yaml", *logs, "--json")
    assert code == 0
    one = json.loads(out)["observers"]["o"]
    assert one["runs"] <= 40
    assert one["gains"]["plant.parameters.k"] == pytest.approx(4, rel=1e-3)
    assert one["gains"]["plant.parameters.d"] == pytest.approx(0, abs=1e-3)
    assert one["held_out"]["holdout_rmse(o, *)"] < 0.05  # in standard deviations
    assert one["standard_errors"]["plant.parameters.k"] < 1e-3
    assert set(one["standard_errors"]) == set(one["gains"])
    written = yaml.safe_load((shell.folder / "results" / "tuned.tuned.yaml").read_text())
    assert written["plant"]["parameters"]["k"] == pytest.approx(one["gains"]["plant.parameters.k"], rel=1e-5)


def test_what_was_set_stands_in_the_tuned_file(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise it would be another configuration than the one that was tuned: here one without the observer."""

    def at_once(*_: object) -> object:
        return SimpleNamespace(sought=[], gains={"observers.NEW.theta": 2.5}, remarks=(), kept=False)

    monkeypatch.setattr(tune_data, "_tuned", at_once)
    monkeypatch.setattr(tune_data, "_table", lambda _: "")
    changed(shell, "gains", {"observers.NEW.theta": {"log": [2, 4]}})
    new, plant = "observers.NEW={type: shgo, theta: 3, poles: -1}", "plant.parameters.k=4"
    words = ["--set", new, "--set", plant, "--set", "tune.minimise=holdout_rmse(NEW, a)"]
    code, _, err = shell("tune", "tuned.yaml", *words)
    assert (code, err) == (0, "hgorun: tuned: results/tuned.tuned.yaml has the values of --set, too\n")
    text = (shell.folder / "results" / "tuned.tuned.yaml").read_text()
    assert text.startswith(f"# --set {new}\n# --set {plant}\nextends: ../tuned.yaml\n")
    written = yaml.safe_load(text)
    assert written["observers"] == {"NEW": {"type": "shgo", "theta": 2.5, "poles": -1}}
    assert written["plant"] == {"parameters": {"k": 4}}
    assert "tune" not in written
    code, _, err = shell("estimate", "results/tuned.tuned.yaml", "--export-samples", "-", "-q")
    assert (code, err) == (0, "")


@pytest.mark.slow
def test_the_score_of_two_recordings_is_their_root_mean_square(shell: Shell) -> None:
    changed(shell, "gains", {"observers.*.theta": {"log": [2, 2.0000001]}})
    values = []
    for logs in (["one.csv"], ["two.csv"], ["one.csv", "two.csv"]):
        code, out, _ = shell("tune", "tuned.yaml", *logs, "--json")
        assert code == 0
        values.append(json.loads(out)["observers"]["o"]["held_out"]["holdout_rmse(o, *)"])
    assert values[2] == pytest.approx(np.sqrt((values[0] ** 2 + values[1] ** 2) / 2), rel=1e-6)


@pytest.mark.measured
@pytest.mark.slow
def test_innovations_of_all_outputs(shell: Shell) -> None:
    changed(shell, "minimise", "innovation_rms(o, *)")
    code, out, _ = shell("tune", "tuned.yaml")
    assert code == 0
    assert "innovation_rms *: search" in out
    code, out, _ = shell("tune", "tuned.yaml", "--json")
    (found,) = json.loads(out)["observers"].values()
    (search,), (report,) = found["tuned"].values(), found["held_out"].values()
    assert report != search  # of samples that the search has not seen
    assert report == pytest.approx(search, rel=0.5)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("minimise", "holdout_rmse(*, *)", "observers share the plant"),
        ("gains", {"plant.parameters.m": {"log": [1, 2]}}, "no such parameter; there are d, k"),
        ("gains", {"plant.initial.a": {"log": [1, 2]}}, "and parameters of the plant"),
        ("gains", {f"observers.o.poles.{i}": {"linear": [-2, -1]} for i in range(7)}, "expected 1 to 6 gains"),
        ("gains", {"observers.o.poles.0": {"linear": [-2, -1]}}, "observers.o.poles"),
        (
            "gains",
            {"observers.o.theta": {"linear": [-5, 5]}},
            "tune.gains.observers.o.theta: expected a number above 0, found -5.0 (for the value -5)",
        ),
        ("gains", {"observers.*.theta": {"linear": [-5, 5]}}, "tune.gains.observers.*.theta: expected"),
    ],
)
def test_what_cannot_be_sought_is_said(shell: Shell, key: str, value: object, message: str) -> None:
    changed(shell, key, value)
    code, _, err = shell("tune", "tuned.yaml")
    assert code == 2
    assert message in err


def test_the_line_of_a_range_that_is_refused_is_its_own(shell: Shell) -> None:
    file = shell.folder / "tuned.yaml"
    file.write_text(
        file.read_text().replace("observers.o.theta: {log: [0.3, 8]}", "observers.o.theta: {linear: [-5, 5]}")
    )
    line = file.read_text().splitlines().index("    observers.o.theta: {linear: [-5, 5]}") + 1
    assert f"tuned.yaml:{line}: tune.gains.observers.o.theta: " in shell("tune", "tuned.yaml")[2]


def test_all_outputs_are_counted_in_deviations_that_are_stated(shell: Shell) -> None:
    file = shell.folder / "tuned.yaml"
    file.write_text(file.read_text().replace(", std: 0.02", ""))
    code, _, err = shell("tune", "tuned.yaml")
    assert code == 2
    assert "b has no std" in err


def test_gains_that_go_with_nothing_else_are_said_as_they_are(shell: Shell) -> None:
    changed(shell, "gains", {"observers.p.theta": {"log": [1, 2]}})
    changed(shell, "minimise", "holdout_rmse(p, a)")
    code, _, err = shell("tune", "tuned.yaml")
    assert code == 2
    assert "given by one of Q, q and theta" in err


@pytest.mark.parametrize(
    ("rows", "period", "goal", "said"),
    [
        (["1.0,0.5"], 0.05, "reference_rmse(o, b)", "1 sample is too few for a search"),
        (["1.0,0.5", "2.0,0.1"], 5.99, "holdout_rmse(o, a)", "all samples that data.period holds out lie in one gap"),
    ],
)
def test_samples_that_leave_none_for_the_report_are_too_few(
    shell: Shell, rows: list[str], period: float, goal: str, said: str
) -> None:
    """A reference that was measured once; all that is left out between two samples."""
    (shell.folder / "aside.csv").write_text("\n".join(["t,b", *rows, ""]))
    config = yaml.safe_load(CONFIG)
    del config["plant"]["inputs"]
    config["plant"]["parameters"] = {"k": 4, "d": 0}
    config["plant"]["output"] = "a"
    config["data"] |= {"period": period, "outputs": {"a": {"column": "a", "std": 0.01}}}
    config["data"]["reference"] = {"b": {"file": "aside.csv", "column": "b"}}
    config["observers"] = {"o": config["observers"]["o"]}
    config["tune"] |= {"gains": {"observers.o.theta": {"log": [0.3, 8]}}, "minimise": goal}
    (shell.folder / "tuned.yaml").write_text(yaml.safe_dump(config))
    code, _, err = shell("tune", "tuned.yaml", "-q")
    assert (code, f"{goal}: {said}" in err) == (2, True), err


def test_files_are_for_recordings(shell: Shell) -> None:
    config = yaml.safe_load((shell.folder / "tuned.yaml").read_text())
    del config["data"]
    (shell.folder / "tuned.yaml").write_text(yaml.safe_dump(config))
    code, _, err = shell("tune", "tuned.yaml", "one.csv")
    assert code == 2
    assert "files are for recordings" in err


@pytest.mark.costly
def test_why_no_run_can_be_made_with_any_gains_is_said(shell: Shell) -> None:
    """It is no divergence."""
    changed(shell, "gains", {"observers.o.internal.x": {"log": [0.1, 10]}})
    changed(shell, "budget", 20)
    code, _, err = shell("tune", "tuned.yaml")
    assert (code, "observers.o.internal: unknown internal state 'x'" in err) == (2, True), err


def test_gains_by_which_every_estimate_is_lost(shell: Shell) -> None:
    changed(shell, "gains", {f"observers.o.{key}": {"log": [1e5, 2e5]} for key in ("theta",)})
    code, _, err = shell("tune", "tuned.yaml")
    assert code == 1
    assert "the observer diverges with all of them" in err


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ("holdout_rmse(FHGO r=2, a)", "FHGO r=2"),
        ("holdout_rmse( *,a )", "*"),
        ("""holdout_rmse('FHGO (r=2)', "a")""", "FHGO (r=2)"),
        ("""holdout_rmse("theta's, both", a)""", "theta's, both"),
    ],
)
def test_a_label_may_have_what_a_call_has(text: str, label: str) -> None:
    """In quotes, as in claims."""
    assert read_goal(text, ()) == Goal("holdout_rmse", label, "a")


@pytest.mark.parametrize(
    "text", ["holdout_rmse(FHGO (r=2), a)", "holdout_rmse('o, a)", "holdout_rmse(o, a", "rmse(o, a)"]
)
def test_a_call_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(Problem, match="can be minimised, as in"):
        read_goal(text, ())


def test_gains_stand_in_the_table_as_in_the_file() -> None:
    """Each observer has some of them."""
    found: list[Any] = [
        SimpleNamespace(
            goal=Goal("holdout_rmse", label, "a"),
            gains=gains,
            tuned=1.0,
            held_out=2.0,
            runs=20,
            budget=20,
            spread={},
        )
        for label, gains in (("o", {"observers.o.theta": 3.0}), ("p", {"observers.p.theta": 4.0, "observers.p.r": 5.0}))
    ]
    header, *rows = tune_data._table(found).splitlines()
    assert header.split() == ["theta", "r", "holdout_rmse", "a:", "search", "held", "out", "runs"]
    assert [row.split()[:3] for row in rows] == [["o", "3.000", "-"], ["p", "4.000", "5.000"]]


@pytest.mark.parametrize(
    ("gain", "kept"),
    [("observers.o.theta", "those of the file are kept"), ("observers.p.Q.a", "those that are written are no better")],
)
def test_where_all_gains_are_equally_good_those_of_the_file_are_kept(shell: Shell, gain: str, kept: str) -> None:
    """As where nothing moves: any other would be chosen by chance."""
    rows = ["t,a,b", *(f"{t:.2f},0,0" for t in 0.1 * np.arange(31))]
    (shell.folder / "one.csv").write_text("\n".join(rows) + "\n")
    changed(shell, "gains", {gain: {"log": [0.3, 8]}})
    changed(shell, "minimise", f"holdout_rmse({gain.split('.')[1]}, a)")
    code, out, err = shell("tune", "tuned.yaml", "--json")
    assert code == 0, err
    assert f"all candidates are equally good, so that nothing is known of {gain.split('.', 2)[2]}: {kept}" in err
    (one,) = json.loads(out)["observers"].values()
    assert one["runs"] < 40
    assert one["standard_errors"] == {}
    written = yaml.safe_load((shell.folder / "results" / "tuned.tuned.yaml").read_text())["observers"]
    if gain == "observers.o.theta":
        assert one["gains"] == {gain: 2}
        assert written["o"]["theta"] == 2
    else:
        assert written["p"]["Q"]["a"] == pytest.approx(one["gains"][gain], rel=1e-5)


def test_gains_of_an_observer_that_nothing_is_asked_of_are_refused(shell: Shell) -> None:
    """As in a simulation, where they would change nothing either."""
    gains = {"observers.o.theta": {"log": [0.3, 8]}, "observers.p.Q.b": {"log": [0.1, 10]}}
    changed(shell, "gains", gains)
    code, out, err = shell("tune", "tuned.yaml")
    assert (code, out) == (2, "")
    assert err == "hgorun: tuned.yaml:48: tune.gains.observers.p.Q.b: nothing of observer p is minimised or bounded\n"
