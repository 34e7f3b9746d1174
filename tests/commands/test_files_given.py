"""Files as commands are given them, and as they leave them: nothing is done to one without a word."""

from __future__ import annotations

from pathlib import Path

import pytest
from shell import Shell

SMALL = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {S: {type: shgo, theta: 2}}
"""

NOISE = "measurement: {noise: [{type: gaussian, std: 0.1, hold: 0.1}]}\n"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "a.yaml").write_text(SMALL)
    return Shell(tmp_path, monkeypatch, capsys)


def test_a_result_that_is_replaced_is_told(shell: Shell) -> None:
    assert shell("simulate", "a.yaml", "--export-csv", "a.csv")[1].endswith("written: results/a.h5, a.csv\n")
    again = shell("simulate", "a.yaml", "--export-csv", "b.csv")[1]
    assert again.endswith("written: results/a.h5 (replaced), b.csv\n")


def test_files_of_one_name_are_refused_by_simulate(shell: Shell) -> None:
    """Their results are called alike; what the message advises keeps both."""
    (shell.folder / "b b").mkdir()
    (shell.folder / "b b" / "a.yaml").write_text(SMALL.replace("theta: 2", "theta: 3"))
    code, out, err = shell("simulate", "a.yaml", "b b/a.yaml")
    assert (code, out) == (2, "")
    assert err == (
        "hgorun: a.yaml and b b/a.yaml have the same name, and results are named after it: give each a folder, as in "
        "`hgorun simulate 'b b/a.yaml' -o FOLDER`\n"
    )
    assert not (shell.folder / "results").exists()
    assert shell("simulate", "a.yaml", "a.yaml")[0] == 2


@pytest.mark.slow
def test_files_of_one_name_are_numbered_by_compare(shell: Shell) -> None:
    (shell.folder / "b").mkdir()
    (shell.folder / "b" / "a.yaml").write_text(SMALL.replace("theta: 2", "theta: 3"))
    assert shell("simulate", "a.yaml", "-q")[0] == 0
    assert shell("simulate", "b/a.yaml", "-o", "results/b", "-q")[0] == 0
    compared = shell("compare", "a.yaml", "b/a.yaml", "--no-plots")[1]
    assert "a (2): S" in compared
    assert compared.splitlines()[0] == "a"
    stored = shell("compare", "results/a.h5", "results/b/a.h5", "--no-plots")[1]
    assert stored.split("status")[1] == compared.split("status")[1]


def test_the_name_of_an_experiment_stands_for_it(shell: Shell) -> None:
    code, out, err = shell("simulate", "contois_te025")
    assert (code, out.endswith("written: results/contois_te025.h5\n")) == (0, True), err
    assert "no file here; this is the experiment robles2023/chapter3/contois_te025, which `hgorun init" in err
    code, _, err = shell("simulate", "contois_te025.yaml")
    assert (code, "`hgorun init contois_te025` copies the experiment" in err) == (2, True)
    code, _, err = shell("simulate", "contois_te026")
    assert (code, "contois_te026" in err) == (2, True)


@pytest.mark.parametrize("command", ["simulate", "figures", "claims"])
def test_a_file_here_comes_before_an_experiment_that_is_called_alike(shell: Shell, command: str) -> None:
    more = "figures: {f: {panels: [{error: x1}]}}\nclaims: [{id: c, claim: small, value: largest(x1), below: 1e3}]\n"
    (shell.folder / "contois_te025.yaml").write_text(SMALL + more)
    code, out, err = shell(command, "contois_te025")
    assert (code, "contois_te025: taking contois_te025.yaml; where" in err) == (0, True), err
    assert {"simulate": "contois_te025.h5", "figures": "f: results/", "claims": "1 claims: "}[command] in out


@pytest.mark.measured
@pytest.mark.slow
def test_ensembles_that_compare_leaves_out_are_told(shell: Shell) -> None:
    runs = "runs: {one: {}, many: {seeds: 2}}\n"
    (shell.folder / "a.yaml").write_text(SMALL + NOISE + runs)
    code, out, err = shell("compare", "a.yaml", "--no-plots")
    assert (code, "ensembles are left out: many" in err, "S" in out) == (0, True, True), err
    code, out, _ = shell("simulate", "a.yaml")
    assert "written: results/a/one.h5" in out
    assert "written: results/a/many.sweep.h5" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("simulate", "a.yaml", "-o", "out.csv"), "--export-csv FILE writes the states over time"),
        (("simulate", "a.yaml", "-o", "out.png"), "hgorun compare CONFIG -o FILE.png draws"),
        (("simulate", "a.yaml", "-o", "out.json"), "--json prints JSON, which > FILE writes"),
        (("simulate", "a.yaml", "-o", "out.xlsx"), "expected a file .h5, .hdf5, .nc or a folder, found out.xlsx"),
        (("compare", "a.yaml", "-o", "out.csv"), "hgorun compare --format csv prints a table, which > FILE writes"),
        (("compare", "a.yaml", "-o", "out.tex"), "hgorun compare --format latex prints a table"),
        (("compare", "a.yaml", "-o", "out.svg"), "expected a file .pdf, .png or a folder"),
        (("analyze", "a.yaml", "-o", "out.csv"), "expected a file .pdf, .png or a folder, found out.csv"),
        (("estimate", "a.yaml", "-o", "out.csv"), "--export-csv FILE writes the estimates"),
        (("export", "a.yaml", "-o", "out.c"), "expected a folder, found out.c"),
        (("compare", "a.yaml", "-o", "out.docx"), "expected a file .pdf, .png or a folder, found out.docx; if it is a"),
        (("tune", "a.yaml", "-o", "out.zarr"), "expected a folder, found out.zarr"),
        (("figures", "a.yaml", "-o", "out.xyz"), "expected a folder, found out.xyz"),
        (("simulate", "a.yaml", "--export-csv", "out.xlsx"), "expected a file .csv, .dat, .txt, found out.xlsx"),
        (("estimate", "a.yaml", "--export-csv", "out.h5"), "expected a file .csv, .dat, .txt, found out.h5"),
    ],
)
def test_an_output_means_what_its_name_says_or_is_refused(shell: Shell, arguments: tuple[str, ...], words: str) -> None:
    code, _, err = shell(*arguments)
    assert (code, words in err) == (2, True), err
    assert not (shell.folder / arguments[-1]).exists()


@pytest.mark.parametrize("name", ["run.2", "theta0.5", "results.v2", "there.docx"])
def test_a_folder_may_have_a_point_in_its_name(shell: Shell, name: str) -> None:
    (shell.folder / "there.docx").mkdir()
    (shell.folder / "a.yaml").write_text(SMALL)
    assert shell("simulate", "a.yaml", "-q", "-o", name)[0] == 0
    assert (shell.folder / name / "a.h5").is_file()
