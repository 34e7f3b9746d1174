"""The paper keeps to what its journal asks for, and to what the program is."""

import re
from pathlib import Path

import pytest
import yaml

from hgorun.observers.base import OBSERVERS

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
HEAD, BODY = TEXT.split("---\n", 2)[1:]
SECTIONS = [
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
]


def test_its_length_is_permitted() -> None:
    assert 750 <= len(re.findall(r"\w[\w'.-]*", re.sub(r"\[@.*?\]", "", BODY, flags=re.DOTALL))) <= 1750


def test_it_has_the_sections_in_their_order() -> None:
    assert re.findall(r"^# (.+)$", BODY, re.MULTILINE) == SECTIONS


def test_its_head_is_complete() -> None:
    head = yaml.safe_load(HEAD)
    assert head.keys() == {"title", "tags", "authors", "affiliations", "date", "bibliography"}
    assert {author["affiliation"] for author in head["authors"]} == {place["index"] for place in head["affiliations"]}
    assert (ROOT / "paper" / head["bibliography"]).is_file()


def test_citations_and_references_are_the_same() -> None:
    references = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{(\w+),$", references, re.MULTILINE)
    assert sorted(set(entries)) == sorted(entries)
    assert set(re.findall(r"@(\w+)", BODY)) == set(entries)


@pytest.mark.parametrize("page", ["docs/joss.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md"])
def test_the_files_that_pages_name_are_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    named = re.findall(r"`((?:[\w.]+/)*[A-Z_]+\.md|[\w.]+/)`", text)
    assert [link for link in links if not ((ROOT / page).parent / link).exists()] == []
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_numbers_of_claims_are_those_of_the_report() -> None:
    report = (ROOT / "results" / "REPORT.md").read_text(encoding="utf-8").splitlines()
    (start,) = (number for number, line in enumerate(report) if line.startswith("| publication | figures | claims |"))
    names = [name.strip() for name in report[start].strip("|").split("|")]
    rows = [line.strip("|").split("|") for line in report[start + 2 :]]
    rows = rows[: next(number for number, row in enumerate(rows) if len(row) != len(names))]
    total = {name: sum(int(row[column]) for row in rows) for column, name in enumerate(names) if column}
    numbers = (
        f"Of {total['claims']} statements",
        f"{total['confirmed']} are confirmed",
        f"{total['refuted']} are refuted",
    )
    assert all(number in " ".join(BODY.split()) for number in (*numbers, f"{total['depends']} depend"))
    assert total["undecidable"] == 1
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"Of {total['claims']} claims, {total['confirmed']} are confirmed and {total['refuted']} refuted" in readme
    assert f"; {total['depends']} depend on something" in readme


def test_the_number_of_observers_is_that_of_the_package() -> None:
    own = [name for name, cls in OBSERVERS.all().items() if cls.__module__.startswith("hgorun.")]
    assert f"There are {len(own)} observers" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"The package contains {len(own)} observers" in BODY
    assert f"| {len(own)} observers behind one interface" in (ROOT / "docs" / "joss.md").read_text(encoding="utf-8")
