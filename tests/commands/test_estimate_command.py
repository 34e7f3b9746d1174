"""``hgorun estimate``: recordings from files, hold-outs, tuned gains."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pendulum_log import CONFIG, write
from shell import Shell

from hgorun.data.recording import Origin
from hgorun.figures.drawing import comparison
from hgorun.result.reading import read
from hgorun.tables.metrics import as_json


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    write(tmp_path)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.measured
@pytest.mark.slow
def test_a_recording_becomes_a_result_with_scores_and_a_figure(shell: Shell) -> None:
    code, out, err = shell("estimate", "pendulum.yaml", "--holdout", "a=5", "--export-csv", "out.csv")
    assert (code, err) == (0, "")
    assert "holdout_rmse a" in out
    assert "written: results/pendulum.h5, out.csv, results/pendulum.png, results/pendulum.pdf" in out
    found = read(shell.folder / "results" / "pendulum.h5")
    assert found.kind == "estimate"
    rows = (shell.folder / "out.csv").read_text().splitlines()
    assert rows[0] == "t,observer,a,b,a_lower,a_upper,b_lower,b_upper"
    assert rows[1].startswith("0.0,o,0.0,1.0,")
    assert len(rows) == found.time.size + 1
    code, out, _ = shell("compare", "results/pendulum.h5", "--no-plots")
    assert code == 0
    assert "innovation_rms a" in out
    assert shell("rerun", "results/pendulum.h5", "--check")[0] == 2


def test_json_and_a_hold_out_in_a_file(shell: Shell) -> None:
    code, out, _ = shell(
        "estimate", "pendulum.yaml", "log.csv", "--holdout", "a=more.csv", "--json", "--no-plots", "-o", "x.h5"
    )
    told = json.loads(out)
    assert code == 0
    assert (told["kind"], told["file"], told["status"]) == ("estimate", "x.h5", "ok")
    assert set(told["observers"]["o"]) >= {"status", "scores"}
    assert told["observers"]["o"]["scores"]["holdout_rmse"]["a"] < 0.2


def test_scores_as_latex(shell: Shell) -> None:
    """As many columns in each line, and the numbers of the table of text."""
    two = "observers={o: {type: shgo, theta: 3}, p: {type: shgo, theta: 5}}"
    given = ("--set", two, "--holdout", "a=5", "--no-plots", "--no-sensitivity")
    assert shell("estimate", "pendulum.yaml", *given, "-q")[0] == 0
    code, out, _ = shell("compare", "results/pendulum.h5", "--no-plots", "--format", "latex")
    assert code == 0
    width = len(re.findall(r"\\begin{tabular}{l(r+)}", out)[0])
    for line in out.splitlines():
        spans = [int(n) - 1 for n in re.findall(r"\\multicolumn{(\d+)}{c}", line)]
        assert line.count(" & ") + sum(spans) in (0, width), line
    scores = read(shell.folder / "results" / "pendulum.h5").observers
    errors = [one.assessed.scores["holdout_rmse"]["a"] for one in scores.values() if one.assessed]
    best, other = sorted(f"{error:.4g}" for error in errors)
    assert rf"$\mathbf{{{best}}}$" in out
    assert f"${other}$" in out
    assert "bold: smallest" in out
    assert r"\multicolumn{1}{c}{innovation\_rms}" in out


def test_one_of_several_runs(shell: Shell) -> None:
    file = shell.folder / "pendulum.yaml"
    file.write_text(CONFIG + "runs: {slow: {observers: {o: {theta: 1}}}, fast: {}}\n")
    code, _, err = shell("estimate", "pendulum.yaml")
    assert code == 2
    assert "slow, fast with --run" in err
    assert shell("estimate", "pendulum.yaml", "--run", "slow", "--no-plots", "-q", "--no-sensitivity")[0] == 0
    assert read(shell.folder / "results" / "slow.h5").observers["o"].gains["theta"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--holdout", "b=5"), "no such output"),
        (("--holdout", "a=1"), "at least 2"),
        (("--holdout", "z=more.csv"), "nor data.reference says in which column z stands; known there: a\n"),
        (("--holdout", "A=more.csv"), "says in which column A stands; known there: a. Did you mean `a`?\n"),
        (
            ("--holdout", "b=more.csv"),
            'b stands: write below data, with the column\'s name, reference: {b: {file: "more.csv", column: COLUMN}}\n',
        ),
        (
            ("--holdout", "a=2.5"),
            "--holdout a=2.5: expected N, of which every N-th sample is held out, or a file; 2.5: there is no such",
        ),
        (("--holdout", "a=0.2"), "or a file; 0.2 of them is a=5; 0.2: there is no such file"),
        (("--holdout", "a=25%"), "or a file; 25% of them is a=4; 25%: there is no such file"),
        (("--holdout", "a=5", "--holdout", "a=3"), "--holdout a=3: samples of a are held out already"),
        (("--set", "time.start=100"), "time.start: there are no data then: they are from 0 to 9.9"),
        (("--set", "time.end=-1"), "time.end: there are no data then: they are from 0 to 9.9"),
        (("--set", "data.inputs={v: angle}"), "data.inputs.v: nothing depends on this input"),
        (("--run", "x"), "has no runs"),
        (("--every", "1"), "for streams"),
        (("--set", "data.outputs.a.column=nothing"), "no column"),
        (("--set", "data.outputs.a.std=5 %"), "data.outputs.a.std: 5 %: std is absolute, in the model's unit"),
        (("nothing.csv",), "nothing.csv"),
        (("--set", "data.file=[log.csv, mor.csv]"), "mor.csv: there is no such file. Did you mean `more.csv`?\n"),
        (("--set", "data.file=[log.csv, pendulm.csv]"), "pendulm.csv: there is no such file\n"),
        (("-", "log.csv"), "no files beside it"),
        (("-", "--holdout", "a=5"), "leave out --holdout"),
        (("-", "--every", "0"), "above 0"),
    ],
)
def test_what_is_wrong_is_said(shell: Shell, arguments: tuple[str, ...], message: str) -> None:
    code, out, err = shell("estimate", "pendulum.yaml", *arguments)
    assert (code, out) == (2, "")
    assert message in err


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("time: {start: 1}", "10 samples lie outside of the run: own.yaml:2: time.start = 1; for the whole recording"),
        ("time: {start: 0.05}", "a: 1 sample lies outside of the run: own.yaml:2: time.start = 0.05; for the whole"),
        ("time:\n  end: 4.05", "59 samples lie outside of the run: own.yaml:3: time.end = 4.05; for the whole"),
        (
            "\ntime: {start: 1}",
            "69 samples lie outside of the run: own.yaml:3: time.start = 1, base.yaml:2: time.end = 4.05; for the "
            "whole recording leave that out, or write `time: null` where it is inherited",
        ),
        ("time: null", ""),
    ],
)
def test_what_shortens_a_run_is_named_with_its_line(shell: Shell, given: str, told: str) -> None:
    inherited = "\ntime: {end: 4.05}\n" if told.count("time.") != 1 else ""
    (shell.folder / "base.yaml").write_text(inherited + CONFIG)
    (shell.folder / "own.yaml").write_text(f"extends: base.yaml\n{given}\n")
    code, _, err = shell("estimate", "own.yaml", "-q", "--no-plots", "--no-sensitivity")
    assert (code, err.count("\n")) == (0, 1 if told else 0), err
    assert told in err


def test_metrics_that_do_not_fit_a_recording_are_to_be_left_out(shell: Shell) -> None:
    (shell.folder / "base.yaml").write_text(f"metrics:\n  window: [5, 20]\n{CONFIG}")
    (shell.folder / "own.yaml").write_text("extends: base.yaml\n")
    code, _, err = shell("estimate", "own.yaml", "-q", "--no-plots", "--no-sensitivity")
    assert code == 2
    assert "base.yaml:2: metrics.window: [5, 20] reaches outside the run, which lasts from 0 to 9.9" in err
    assert "leave the block out, or write `metrics: null` where it is inherited" in err
    (shell.folder / "own.yaml").write_text("extends: base.yaml\nmetrics: null\n")
    assert shell("estimate", "own.yaml", "-q", "--no-plots", "--no-sensitivity")[0] == 0


def test_what_was_found_in_a_log_is_said_where_an_estimate_fails(shell: Shell) -> None:
    """A stamp that jumps makes a grid that no memory holds: the line of the jump is what helps."""
    log = shell.folder / "log.csv"
    rows = log.read_text().splitlines()
    log.write_text("\n".join([*rows[:30], *("1e9" + row[row.index(",") :] for row in rows[30:31])]) + "\n")
    code, _, err = shell("estimate", "pendulum.yaml", "--no-plots")
    first, second = err.splitlines()
    assert code == 2
    assert "log.csv:31: outputs.a: the time stamps jump by more than 20 usual steps" in first
    assert "the output grid has" in second


def test_without_data_there_is_nothing_to_estimate(shell: Shell) -> None:
    (shell.folder / "none.yaml").write_text(CONFIG.replace("data:", "figures:").split("figures:", maxsplit=1)[0])
    code, _, err = shell("estimate", "none.yaml")
    assert code == 2
    assert "the key data is missing" in err


@pytest.mark.costly
def test_a_file_that_is_held_out_has_the_columns_that_the_reference_names_there(shell: Shell) -> None:
    (shell.folder / "laboratory.csv").write_text("drawn,phi\n2.05,0.88\n3.05,0.09\n4.05,-0.79\n")
    of_laboratory = "data.reference={a: {file: laboratory.csv, column: phi, time: drawn}}"
    words = ("--holdout", "a=laboratory.csv", "--set", of_laboratory, "--no-plots", "--no-sensitivity")
    code, _, err = shell("estimate", "pendulum.yaml", *words)
    assert (code, err) == (0, "")
    scores = json.loads(shell("estimate", "pendulum.yaml", *words, "--json")[1])["observers"]["o"]["scores"]
    assert scores["holdout_rmse"] == scores["reference_rmse"]
    code, _, err = shell("estimate", "pendulum.yaml", "--holdout", "a=laboratory.csv", "--no-plots")
    assert code == 2
    assert "has no column 'angle'" in err
    assert 'data.reference: {a: {file: "laboratory.csv", column: COLUMN, time: COLUMN}} reads a file' in err


def test_dates_of_a_file_that_is_held_out_count_from_the_start_of_the_log(shell: Shell) -> None:
    rows = (f"2026-03-01T06:{m:02d}:00,{np.sin(m / 60):.4f}" for m in range(0, 60, 2))
    (shell.folder / "log.csv").write_text("t,angle\n" + "\n".join(rows) + "\n")
    (shell.folder / "lab.csv").write_text("t,angle\n2026-03-01T06:30:00,0.48\n2026-03-01T06:45:00,0.68\n")
    of_laboratory = "data.reference={a: {file: lab.csv, column: angle}}"
    words = ("--set", "time.unit=h", "--no-plots", "--no-sensitivity", "--holdout", "a=lab.csv")
    code, out, err = shell("estimate", "pendulum.yaml", *words, "--set", of_laboratory)
    assert code == 0, err
    found = read(shell.folder / "results" / "pendulum.h5")
    assert found.recorded is not None
    assert found.recorded.held_out["a"].taken.tolist() == found.recorded.reference["a"].taken.tolist() == [0.5, 0.75]
    scores = found.observers["o"].assessed
    assert scores is not None
    assert scores.scores["holdout_rmse"] == scores.scores["reference_rmse"]
    origin = found.recorded.time_origin
    assert origin == "2026-03-01T06:00:00"
    assert f"time 0 is {origin}\n" in out
    assert as_json(found)["time_origin"] == origin
    assert [ax.get_xlabel() for ax in comparison(found).axes][-1] == f"time [h] since {origin.replace('T', ' ')}"


def test_figures_beside_data_are_told_to_be_of_no_use(shell: Shell) -> None:
    """Of a log there is one figure, of everything."""
    given = ("--set", "figures={f: {panels: [{state: x1}]}}", "--no-plots", "--no-sensitivity", "--quiet")
    code, _, err = shell("estimate", "pendulum.yaml", *given)
    assert code == 0
    assert "pendulum: figures of recorded data have all states and the whole run: the key figures is not used" in err


@pytest.mark.parametrize(
    ("epoch", "zone", "text"),
    [
        (None, "", ""),
        ("2026-03-01", "", "2026-03-01T00:00:00"),
        ("2026-03-01T06:00:00.250", "UTC", "2026-03-01T06:00:00.250Z"),
        ("1969-12-31T23:59:59.000000001", "", "1969-12-31T23:59:59.000000001"),
    ],
)
def test_the_date_of_time_0_has_all_its_digits(epoch: str | None, zone: str, text: str) -> None:
    date = None if epoch is None else np.datetime64(epoch, "ns")
    assert Origin(unit="s", epoch=date, zone=zone).text == text


@pytest.mark.parametrize(
    ("log", "lab", "message"),
    [
        ("2026-03-01T06:0{}:00", "0.{}", "numbers here and dates in the log: data.origin has to say"),
        ("0.{}", "2026-03-01T06:0{}:00", "dates here and numbers in the log"),
        ("2026-03-01T06:0{}:00", "2026-03-01T06:0{}:00Z", "the dates have a time zone, and those of the log have none"),
        ("2026-03-01T06:0{}:00Z", "2026-03-01T06:0{}:00", "the dates have no time zone, and those of the log have one"),
    ],
)
def test_a_file_that_is_held_out_is_on_the_clock_of_the_log(shell: Shell, log: str, lab: str, message: str) -> None:
    for name, stamp in (("log", log), ("lab", lab)):
        rows = (f"{stamp.format(i)},0.{i}" for i in range(1, 9))
        (shell.folder / f"{name}.csv").write_text("t,angle\n" + "\n".join(rows) + "\n")
    code, _, err = shell("estimate", "pendulum.yaml", "--holdout", "a=lab.csv", "--no-plots", "--no-sensitivity")
    assert code == 2
    assert message in err


TUNE = """
tune: {{gains: {{observers.o.theta: {{log: [0.3, 8]}}}}, minimise: "{goal}", budget: 24, seeds: 1}}
"""


@pytest.mark.costly
def test_gains_are_found_on_a_recording(shell: Shell) -> None:
    file = shell.folder / "pendulum.yaml"
    file.write_text(CONFIG + TUNE.format(goal="holdout_rmse(*, a)"))
    code, out, _ = shell("tune", "pendulum.yaml", "--json")
    assert code == 0
    one = json.loads(out)["observers"]["o"]
    theta = one["gains"]["observers.o.theta"]
    assert one["runs"] <= 24
    assert one["held_out"]["holdout_rmse(o, a)"] < 0.04
    assert f"theta: {theta:.6g}" in (shell.folder / "results" / "pendulum.tuned.yaml").read_text()
    for value in (0.3, 1.5 * theta):  # the search has found the least
        change = f"tune.gains.observers.o.theta.log=[{value}, {value + 1e-6}]"
        code, out, _ = shell("tune", "pendulum.yaml", "--set", change, "--json")
        assert json.loads(out)["observers"]["o"]["tuned"]["holdout_rmse(o, a)"] >= one["tuned"]["holdout_rmse(o, a)"]
    code, _, err = shell("estimate", "results/pendulum.tuned.yaml", "--no-plots", "--no-sensitivity")
    assert (code, err) == (0, "")  # it finds the log


def test_gains_by_a_reference_and_at_the_end_of_a_range(shell: Shell) -> None:
    file = shell.folder / "pendulum.yaml"
    given = CONFIG.replace("observers:", "  reference: {a: angle}\nobservers:")
    file.write_text(given + TUNE.format(goal="reference_rmse(o, a)").replace("8]", "0.5]"))
    code, out, err = shell("tune", "pendulum.yaml", "--set", "tune.budget=150")
    assert code == 0
    assert "reference_rmse a: search" in out
    assert " of 150\n" in out
    assert "o: the search ended before its budget" in out
    assert "theta = 0.5 is at the upper end of its range [0.3, 0.5]: better values may lie beyond it" in err
    assert "write observers.o.theta: {log: [0.3, 5]}" in err
    # on its logarithmic scale a number is in the middle of a range of which it is a thousandth
    file.write_text(given + TUNE.format(goal="reference_rmse(o, a)").replace("8]", "1e5]"))
    code, _, err = shell("tune", "pendulum.yaml")
    assert (code, "end of its range" in err) == (0, False)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("hf(o, a)", "holdout_rmse, innovation_rms, reference_rmse can be minimised"),
        ("holdout_rmse(o, z)", "the output z is not in data.outputs"),
        ("reference_rmse(o, z)", "z is not in data.reference"),
        ("holdout_rmse(p, a)", "no gains of an observer 'p' are sought"),
    ],
)
def test_what_cannot_be_minimised_is_said(shell: Shell, goal: str, message: str) -> None:
    (shell.folder / "pendulum.yaml").write_text(CONFIG + TUNE.format(goal=goal))
    code, _, err = shell("tune", "pendulum.yaml")
    assert code == 2
    assert message in err


@pytest.mark.parametrize(
    ("file", "right"),
    [
        ("log.csv", "name another file"),
        ("pendulum.yaml", "name another file"),
        ("./results/pendulum.h5", "expected a file .csv, .dat, .txt"),
    ],
)
def test_nothing_that_is_read_or_written_is_overwritten(shell: Shell, file: str, right: str) -> None:
    before = {name: (shell.folder / name).read_bytes() for name in ("log.csv", "pendulum.yaml")}
    code, _, err = shell("estimate", "pendulum.yaml", "--export-csv", file)
    assert code == 2
    assert right in err
    assert before == {name: (shell.folder / name).read_bytes() for name in before}


def test_a_recording_is_not_replaced_by_its_result(shell: Shell) -> None:
    (shell.folder / "results").mkdir()
    (shell.folder / "results/pendulum.h5").write_bytes(b"a recording")
    code, _, err = shell("estimate", "pendulum.yaml", "results/pendulum.h5")
    assert code == 2
    assert "--output" in err
    assert (shell.folder / "results/pendulum.h5").read_bytes() == b"a recording"


def test_a_matrix_that_is_a_number_is_reported_under_its_key(shell: Shell) -> None:
    code, _, err = shell("estimate", "pendulum.yaml", "--set", "observers.E={type: ekf, Q: 1}")
    assert code == 2
    assert "observers.E.Q: expected a number for each state" in err


@pytest.mark.parametrize("source", ["log.csv", "-"])
@pytest.mark.parametrize(
    ("outputs", "key"), [("[1]", "outputs"), ("text", "outputs"), ("{a: 3}", "outputs.a"), ("{a: [1]}", "outputs.a")]
)
def test_outputs_of_the_measurement_are_a_mapping(shell: Shell, source: str, outputs: str, key: str) -> None:
    """Also where the block ``data`` adds noise to them."""
    (shell.folder / "pendulum.yaml").write_text(CONFIG + f"measurement: {{outputs: {outputs}}}\n")
    code, _, err = shell("estimate", "pendulum.yaml", source)
    assert code == 2
    assert f"pendulum.yaml:13: measurement.{key}: expected a mapping" in err
