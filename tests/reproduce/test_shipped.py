"""The shipped experiments, and the committed report of them."""

import re
from pathlib import Path

import pytest

from hgorun.config.study import Claim
from hgorun.reproduce.publications import publication
from hgorun.reproduce.shipped import experiments, folder
from hgorun.study.check import check
from hgorun.study.loading import load_study
from hgorun.study.study import Study
from hgorun.study.verdict import VERDICTS

ROOT = Path(__file__).parents[2]
STUDIES = experiments()
FIGURES = {
    "robles2023": [f"2.{i}" for i in range(1, 13)] + [f"3.{i}" for i in range(1, 19)],
    "lee2016": [str(i) for i in range(1, 7)],
    "meiners2025": ["1", "2"],
    "katayama": ["1", "2"],
}


def studies(group: str) -> list[Study]:
    return [load_study(file) for path, file in STUDIES.items() if path.startswith(f"{group}/")]


@pytest.mark.parametrize("path", STUDIES)
def test_names_in_figures_and_claims_are_known(path: str) -> None:
    check(load_study(STUDIES[path]))


@pytest.mark.parametrize("group", FIGURES)
def test_every_figure_of_the_print_is_there_once(group: str) -> None:
    names = [name for study in studies(group) for name in study.figures]
    assert len(set(names)) == len(names)
    assert set(FIGURES[group]) <= set(names)


def test_every_claim_of_the_texts_is_there() -> None:
    ids = [claim.id for file in STUDIES.values() for claim in load_study(file).claims]
    numbers = {int(match[0]) for name in ids if (match := re.match(r"\d+", name))}
    assert numbers == set(range(1, 46))
    assert len(set(ids)) == len(ids)


def escaped(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")


@pytest.mark.parametrize("group", sorted({path.split("/")[0] for path in STUDIES}))
def test_the_committed_report_has_the_verdicts_that_the_files_expect(group: str) -> None:
    known = publication(folder() / group)
    report = (ROOT / "results" / "REPORT.md").read_text(encoding="utf-8")
    section = report[report.index(f"## {known.short}\n") :].split("\n## ")[0]
    rows = {line.split(" | ")[0].removeprefix("| "): line for line in section.splitlines() if line.startswith("| ")}
    claims: list[Claim] = [claim for study in studies(group) for claim in study.claims]
    for claim in claims:
        assert f"**{claim.expected}** |" in rows[claim.id], claim.id
    for study in studies(group):
        for name in study.figures:
            assert f"](report/{group}/{name}.png)" in section
            assert (ROOT / "results" / "report" / group / f"{name}.png").is_file()
    for erratum in known.errata:
        (row,) = [
            line
            for line in section.splitlines()
            if f"| {escaped(erratum.place)} | {escaped(erratum.printed)} |" in line
        ]
        assert row.startswith(f"| {erratum.kind} |") == (erratum.kind != "error")
    (summary,) = [line for line in report.splitlines() if line.startswith(f"| {known.short} |")]
    cells = [cell.strip() for cell in summary.strip("|").split("|")]
    verdicts = [sum(claim.expected == word for claim in claims) for word in VERDICTS]
    errors = sum(erratum.kind == "error" for erratum in known.errata)
    assert list(map(int, cells[2:])) == [len(claims), *verdicts, errors, len(known.errata) - errors]
