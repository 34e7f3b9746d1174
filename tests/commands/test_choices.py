"""What options of the commands choose, and which of them exclude each other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from shell import Shell

import hgorun
from hgorun.commands.remarks import warn
from hgorun.errors import HgorunError
from hgorun.version import __version__

BASE = """
time: {end: 1, output_step: 0.1, unit: s}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {SHGO: {type: shgo, theta: 2}}
solver: {step: 0.01}
"""
RUNS = BASE + "runs: {a: {}, b: {observers: {SHGO: {theta: 3}}}}\n"
FIGURES = BASE + "figures: {first: {panels: [{state: x1}]}}\n"
ENSEMBLE = BASE + "runs: {many: {seeds: 2}}\nfigures: {}\n"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    for name, text in (("base", BASE), ("runs", RUNS), ("figures", FIGURES), ("ensemble", ENSEMBLE)):
        (tmp_path / f"{name}.yaml").write_text(text)
    (tmp_path / "hours.yaml").write_text(BASE.replace("unit: s", "unit: h"))
    return Shell(tmp_path, monkeypatch, capsys)


def test_the_version_is_the_packages(shell: Shell) -> None:
    assert shell("--version") == (0, f"{__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("compare", "base.yaml", "hours.yaml"), "the sources use different units of time: h, s"),
        (("compare", "base.yaml", "--format", "html"), "expected one of text, csv, latex, found 'html'"),
        (
            ("compare", "base.yaml", "--format", "tex"),
            "expected one of text, csv, latex, found 'tex'. Did you mean `latex`",
        ),
        (
            ("export", "base.yaml", "--lang", "tex"),
            "--lang: expected one of c, latex, found 'tex'. Did you mean `latex`?",
        ),
        (("export", "base.yaml", "--fmu", "--fmi", "1"), "--fmi: expected one of 2.0, 3.0, found '1'"),
        (("simulate", "base.yaml", "--set", "seeds=30"), "30 seeds are `runs: {many: {seeds: 30}}`, or `axes: {seed: "),
        (("simulate", "base.yaml", "--set", "seeds={count: 3}"), "50 seeds are `runs: {many: {seeds: 50}}`"),
        (("simulate", "base.yaml", "--set", "vary=[1]"), "A run is varied: `runs: {many: {vary: ...}}`."),
        (("init", "--plant", "own"), "hgorun init --ask asks for equations of your own"),
        (("compare", "base.yaml", "--analyze", "--format", "latex"), "the LaTeX table has metrics only"),
        (("simulate", "runs.yaml", "-o", "all.h5"), "all.h5 is one file, but there are 2 runs in runs.yaml"),
        (("simulate", "base.yaml", "hours.yaml", "-o", "all.h5"), "there are 2 configurations; name a folder"),
        (("compare", "ensemble.yaml"), "all runs are ensembles: many"),
        (("simulate", "base.yaml", "-o", "there.png"), "expected a file .h5, .hdf5, .nc or a folder"),
        (("analyze", "base.yaml", "-o", "base.yaml"), "base.yaml"),
        (("show", "noise"), "'noise' is a list: see hgorun list noise"),
        (("show", "rmsee"), "nothing is called 'rmsee'. Did you mean `rmse`?"),
    ],
)
def test_choices_that_are_refused(arguments: tuple[str, ...], words: str, shell: Shell) -> None:
    code, out, err = shell(*arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert not (shell.folder / "results").exists()


def test_a_result_file_cannot_be_changed(shell: Shell) -> None:
    assert shell("simulate", "base.yaml", "-q", "-o", "base.h5") == (0, "", "")
    for change in (("--seed", "3"), ("--set", "time.end=2")):
        code, out, err = shell("compare", "base.h5", "--no-plots", *change)
        assert (code, out) == (2, "")
        assert "not to result files" in err


@pytest.mark.measured("png")
@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "pdf"])
def test_a_comparison_is_drawn_where_it_is_asked_for(suffix: str, shell: Shell) -> None:
    assert shell("compare", "base.yaml", "-q", "-o", f"there/mine.{suffix}") == (0, "", "")
    assert {p.name for p in (shell.folder / "there").iterdir()} == {f"mine.{suffix}"}


@pytest.mark.measured
@pytest.mark.slow
def test_a_table_for_a_program_has_no_further_line(shell: Shell) -> None:
    code, out, _ = shell("compare", "base.yaml", "--format", "csv")
    assert code == 0
    assert "written" not in out
    assert (shell.folder / "results/base-comparison.png").exists()


def test_one_member_of_an_ensemble_by_name(shell: Shell) -> None:
    code, out, _ = shell("simulate", "ensemble.yaml", "--run", "many", "--json")
    assert (code, json.loads(out)["name"]) == (0, "many")


def test_metrics_and_findings_are_shown_like_the_rest(shell: Shell) -> None:
    for name in ("rmse", "theta_bound"):
        code, out, _ = shell("show", name)
        assert code == 0
        described = json.loads(shell("show", name, "--json")[1])
        assert described["name"] == name
        assert out.split() == " ".join(f"{key}: {value}" for key, value in described.items()).split()


def test_a_figure_is_shown_with_its_experiment_and_the_commands_that_make_it(shell: Shell) -> None:
    code, out, _ = shell("show", "3.9")
    assert code == 0
    assert "experiment: robles2023/chapter3/contois_te025: Contois bioreactor" in out
    assert "draw it: hgorun figures 3.9" in out
    records = json.loads(shell("show", "1", "--json")[1])
    assert [one["name"] for one in records] == ["katayama/1", "lee2016/1", "meiners2025/1"]
    assert json.loads(shell("show", "lee2016/1", "--json")[1])[0]["claims about it"] == ["23a"]
    (folder,) = json.loads(shell("show", "lee2016", "--json")[1])
    assert (folder["kind"], folder["figures"]) == ("folder of experiments", ["1", "2", "3", "4", "5", "6"])
    assert "Did you mean `3.9`?" in shell("show", "3.91")[2]


def test_a_claim_is_shown_by_its_id(shell: Shell) -> None:
    code, out, _ = shell("show", "23a")
    assert code == 0
    assert "The estimate of x1 with SA follows the solution" in out
    assert "measure it: hgorun claims lee2016/stochastic_approximation" in out
    (record,) = json.loads(shell("show", "lee2016/23a", "--json")[1])
    assert (record["kind"], record["figure"], record["below"]) == ("claim", "1", "0.05")
    assert shell("show", "katayama/23a")[0] == 2


def test_the_experiment_is_shown_where_a_plant_is_called_alike(shell: Shell) -> None:
    (record,) = json.loads(shell("show", "katayama/1", "--json")[1])
    assert "observers:" in shell(*record["see its experiment"].split()[1:])[1]
    assert "observers:" not in shell("show", "van_der_pol")[1]


@pytest.mark.costly
@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("3.9", "Estimate of x_1 from the SHGO, theta = 1, T_e = 0.25 h"),
        ("lee2016/4", "Error xhat_1 - x_1 with SA (in the paper x_1 - xhat_1)"),
    ],
)
def test_titles_are_shown_without_the_marks_of_latex(shell: Shell, name: str, title: str) -> None:
    assert f"title: {title}\n" in shell("show", name)[1]
    assert "$" in json.loads(shell("show", name, "--json")[1])[0]["title"]


@pytest.mark.measured
@pytest.mark.slow
def test_a_report_of_ones_own_figures(shell: Shell) -> None:
    code, out, _ = shell("figures", "figures.yaml", "--report", "-o", "drawn")
    assert code == 0
    written = [line.removeprefix("written: ") for line in out.splitlines() if line.startswith("written: ")]
    assert len(written) == 1
    assert "figures/first.png" in (shell.folder / written[0]).read_text()
    assert shell("figures", "figures.yaml", "-q", "-o", "drawn") == (0, "", "")


def test_remarks_are_said_and_are_no_errors(capsys: pytest.CaptureFixture[str], shell: Shell) -> None:
    result = replace(hgorun.simulate(hgorun.load(shell.folder / "base.yaml")), remarks=("one thing", "another"))
    warn(result)
    assert capsys.readouterr().err == "hgorun: base: one thing\nhgorun: base: another\n"


def test_the_file_of_a_run_is_named_once(capsys: pytest.CaptureFixture[str], shell: Shell) -> None:
    result = hgorun.simulate(hgorun.load(shell.folder / "base.yaml"))
    warn(replace(result, remarks=("base.yaml:3: time.end: one", "other.yaml:2: two")))
    assert capsys.readouterr().err == "hgorun: base.yaml:3: time.end: one\nhgorun: base: other.yaml:2: two\n"


@pytest.mark.parametrize(
    ("raised", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "hgorun: interrupted; no file is left half-written\n"),
        (SystemExit(143), 143, "hgorun: terminated; no file is left half-written\n"),
        (MemoryError(), 1, "hgorun: out of memory; a longer time.output_step"),
        (OSError(28, "No space left on device"), 1, "hgorun: No space left on device: the output is incomplete"),
        (HgorunError("it cannot be"), 1, "hgorun: it cannot be\n"),
    ],
)
def test_whatever_ends_a_command_is_one_line(
    raised: BaseException, code: int, words: str, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr("hgorun.commands.simulate.simulate_into", fails)
    found, out, err = shell("simulate", "base.yaml")
    assert (found, out) == (code, "")
    assert err.startswith(words)
    assert err.count("\n") == 1
