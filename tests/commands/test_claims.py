"""``hgorun claims``: what is printed, and when the exit code is not 0."""

import json
from pathlib import Path

import pytest

from hgorun.commands.catalogue_options import Claims
from hgorun.commands.claims import claims

STUDY = """
time: {end: 3, output_step: 0.1}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
observers: {A: {type: shgo, theta: 2}, B: {type: shgo, theta: 2000}}
solver: {step: 0.01}
claims:
  - {id: "1", claim: The error is small., value: "rmse('A', x1)", below: 10}
  - {id: "2", claim: "The error is as large as the truth itself, which takes more than one line to say in a terminal.",
     value: "rmse('A', x1)", above: 10, expect: EXPECTED}
"""
MORE = """  - {id: "3", claim: It is small., value: "sup('A', x1)", below: 1.0e-9, expect: depends,
     alternatives: [{value: "sup('A', x1, 2.9, 3)", below: 10, note: at the end}]}
  - {id: "4", claim: It vanishes., undecidable: It is about a limit.}
"""


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.replace("EXPECTED", "refuted"))
    return path


@pytest.mark.costly
def test_verdicts_are_printed_with_their_numbers(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert claims(Claims(names=[str(study)], strict=True)) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0] == "study"
    assert lines[1].startswith("     1  confirmed    0.")
    assert lines[2] == "        The error is small."
    assert lines[3] == "        value: rmse('A', x1)"
    assert lines[4].startswith("     2  refuted      0.")
    assert lines[-1] == "2 claims: 1 confirmed, 1 refuted"
    assert max(map(len, lines)) <= 100
    assert err.startswith("hgorun: study: study: observer B inaccurate at t=")


def test_a_surprise_is_marked_and_strict_refuses_it(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study.write_text(STUDY.replace("EXPECTED", "confirmed"))
    assert claims(Claims(names=[str(study)])) == 0
    assert claims(Claims(names=[str(study)], strict=True)) == 3
    out = capsys.readouterr().out
    assert "(expected: confirmed)" in out
    assert out.endswith("2 claims: 1 confirmed, 1 refuted; 1 not as expected\n")


def test_json_has_one_record_a_claim_and_quiet_prints_nothing(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert claims(Claims(names=[str(study)], json=True)) == 0
    first, second = json.loads(capsys.readouterr().out)
    assert (first["publication"], first["experiment"]) == ("study", "study")
    assert (first["id"], first["verdict"], second["verdict"]) == ("1", "confirmed", "refuted")
    assert claims(Claims(names=[str(study)], quiet=True)) == 0
    assert capsys.readouterr().out == ""


def test_what_depends_and_what_cannot_be_decided(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study.write_text(STUDY.replace("EXPECTED", "refuted") + MORE)
    assert claims(Claims(names=[str(study)], strict=True)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[8].startswith("     3  depends      ")
    assert lines[9:11] == ["        It is small.", "        value: sup('A', x1)"]
    assert lines[11].startswith("        or ")
    assert lines[11].endswith("(< 10 is claimed), confirmed: at the end; value: sup('A', x1, 2.9, 3)")
    assert lines[12:15] == [
        "     4  undecidable  not measured",
        "        It vanishes.",
        "        It is about a limit.",
    ]
    assert lines[-1] == "4 claims: 1 confirmed, 1 refuted, 1 undecidable, 1 depends"
    assert claims(Claims(names=[str(study)], json=True)) == 0
    *_, third, fourth = json.loads(capsys.readouterr().out)
    assert (third["verdict"], third["alternatives"][0]["verdict"]) == ("depends", "confirmed")
    assert (fourth["verdict"], fourth["value"], fourth["undecidable"]) == ("undecidable", None, "It is about a limit.")


@pytest.mark.parametrize(
    ("measurement", "of_one_seed"),
    [
        ("{noise: [{type: gaussian, std: 0.1}], sampling: {period: 0.1}}", True),
        ("{sampling: {period: 0.1, jitter: 0.02}}", True),
        ("{noise: [{type: sinusoids, terms: [{amplitude: 0.1, omega: 3}]}], sampling: {period: 0.1}}", False),
    ],
)
def test_a_number_of_one_seed_is_called_so(
    study: Path, capsys: pytest.CaptureFixture[str], measurement: str, of_one_seed: bool
) -> None:
    """Whatever is random; that the claim should hold is not stated, so that it does not is no surprise."""
    text = STUDY.replace(", expect: EXPECTED", "").replace(", B: {type: shgo, theta: 2000}", "")
    study.write_text(text + f"measurement: {measurement}\n")
    assert claims(Claims(names=[str(study)], strict=True)) == 3
    lines = capsys.readouterr().out.splitlines()
    assert (" of one seed (> 10 is claimed)" in lines[4]) == of_one_seed
    assert lines[4].startswith("     2  refuted      0.")
    assert lines[4].endswith(" (> 10 is claimed)")
    assert lines[-1] == "2 claims: 1 confirmed, 1 refuted"


def test_another_seed_is_other_noise(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same number as of a file that has the seed itself."""
    noisy = STUDY.replace("EXPECTED", "refuted").replace(", B: {type: shgo, theta: 2000}", "")
    noisy += "measurement: {noise: [{type: gaussian, std: 0.1}], sampling: {period: 0.1}}\n"
    values = []
    for text, seed in ((noisy, None), (noisy, 7), (noisy + "seed: 7\n", None)):
        study.write_text(text)
        assert claims(Claims(names=[str(study)], json=True, seed=seed)) == 0
        first, _ = json.loads(capsys.readouterr().out)
        values.append((first["seed"], first["value"]))
    assert [seed for seed, _ in values] == [0, 7, 7]
    assert values[0][1] != values[1][1] == values[2][1]
