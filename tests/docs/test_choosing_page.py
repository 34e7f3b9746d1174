"""Numbers of the pages of choices and of the benchmark are those of its table of record, which has the file's seeds."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import yaml

from hgorun.observers.base import OBSERVERS

ROOT = Path(__file__).parents[2]
RECORD = ROOT / "experiments" / "benchmark" / "record" / "standings.md"


def _rows(page: Path) -> dict[str, list[str]]:
    """Cells of tables by their first one, without intervals and counts of plants; of equal ones the first."""
    found: dict[str, list[str]] = {}
    for line in page.read_text().splitlines():
        if line.startswith("|"):
            first, *others = line.strip().strip("|").split("|")
            found.setdefault(first.strip(), [cell.split("[")[0].strip() for cell in others])
    return found


def test_numbers_are_those_of_the_record() -> None:
    record = _rows(RECORD)
    page = (ROOT / "docs" / "choosing.md").read_text()
    found = _rows(ROOT / "docs" / "choosing.md")
    shared = {name: cells for name, cells in found.items() if name in record and name != "observer"}
    assert "## What the benchmark found" in page
    assert len(shared) >= 10
    assert shared == {name: record[name] for name in shared}


def test_the_page_of_the_benchmark_has_the_whole_record() -> None:
    rows = [line for line in RECORD.read_text().splitlines() if line.startswith("|")]
    page = (ROOT / "docs" / "benchmark.md").read_text()
    assert len(rows) > 40
    assert "\n".join(rows) in page


def test_how_many_observers_took_part_of_how_many_there_are() -> None:
    with (RECORD.parent / "entries.csv").open() as file:
        labels = {row["observer"] for row in csv.DictReader(file)}
    block = yaml.safe_load((ROOT / "experiments" / "benchmark" / "benchmark.yaml").read_text())["observers"]
    types = {block[label]["block"]["type"] if label in block else label for label in labels}
    own = {name for name, cls in OBSERVERS.all().items() if cls.__module__.startswith("hgorun.")}
    assert types <= own
    said = f"{len(types)} of the {len(own)} "
    choosing, benchmark = ((ROOT / "docs" / page).read_text() for page in ("choosing.md", "benchmark.md"))
    assert f"has {said}observers" in choosing
    assert f"{len(labels)} rows" in choosing
    assert re.search(rf"scores of {len(labels)} observers \({said}in the package", benchmark)


def test_what_late_samples_cost_is_what_the_entries_say() -> None:
    """The four observers named, on the chain of five; no other plant takes more than the 60 % that the page allows."""
    with (RECORD.parent / "entries.csv").open() as file:
        errors = {(r["plant"], r["observer"], r["scenario"]): float(r["error"] or "nan") for r in csv.DictReader(file)}
    page = " ".join((ROOT / "docs" / "benchmark.md").read_text().split())
    for observer in ("extended", "low-pass", "dead zone", "direct, dynamic gain"):
        before, after = (errors["five", observer, scenario] for scenario in ("sampled", "late"))
        assert f"from {before:.1f} to {after:.0f}" in page
    grown = [after / errors[p, o, "sampled"] for (p, o, s), after in errors.items() if s == "late" and p != "five"]
    assert 1.5 < max(ratio for ratio in grown if ratio == ratio) < 1.6
