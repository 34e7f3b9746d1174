"""``benchmark``: observers tuned alike on several plants in several scenarios, scored on seeds not seen."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from hgorun.benchmark import tables
from hgorun.benchmark.benchmark import Benchmark, Entry, load_benchmark
from hgorun.benchmark.contenders import contenders
from hgorun.benchmark.standing import Standing, standings
from hgorun.commands.ensemble_options import Bench
from hgorun.commands.inputs import configuration
from hgorun.commands.outputs import RESULTS, refuse_other_kinds, refuse_unwritable
from hgorun.figures.page import Page
from hgorun.files import json_value, write_text
from hgorun.process import processors
from hgorun.progress import shown


def benchmark(options: Bench) -> int:
    """Carry out what is missing of a benchmark, and write its tables and its figure.

    Raises
    ------
    ConfigError
        For anything wrong in the benchmark's file, or in that of a plant.
    HgorunError
        When a file cannot be written.
    """
    refuse_other_kinds(options.output, ())
    options = replace(options, file=configuration(options.file, "benchmark"))
    page = Page.named(options.width, options.style)
    asked = load_benchmark(options.file)
    folder = (options.output or RESULTS) / asked.name
    refuse_unwritable(folder, kind="folder")
    with shown(asked.size, asked.name, "entries", show=options.text) as progress:
        entries = asked.entries(folder / "entries", options.jobs or processors(), progress.update)
    found = standings(entries)
    files = _write(asked, entries, found, folder, page if options.plots else None)
    if options.json:
        print(json_text.dumps(_as_json(asked, entries, found, files), indent=2, allow_nan=False))
    elif not options.quiet:
        print(tables.text(found, asked.blocks.scenarios))
        print("written: " + ", ".join(map(str, files)))
    return 0


def _write(
    asked: Benchmark,
    entries: Sequence[Entry],
    found: Mapping[tuple[str, str], Standing],
    folder: Path,
    page: Page | None,
) -> list[Path]:
    """Tables, and a figure where there is a page for it."""
    files = [folder / "standings.md", folder / "entries.csv"]
    write_text(files[0], tables.markdown(found, asked.blocks.scenarios, asked.absent))
    write_text(files[1], tables.table(entries))
    if page is not None:
        from hgorun.figures.benchmark import benchmark as draw
        from hgorun.figures.files import save

        files += save(draw(contenders(entries, asked.blocks.scenarios), page), folder / "fronts")
    return files


def _as_json(
    asked: Benchmark, entries: Sequence[Entry], found: Mapping[tuple[str, str], Standing], files: Sequence[Path]
) -> dict[str, object]:
    by_label: dict[str, dict[str, object]] = {}
    for (scenario, label), one in found.items():
        by_label.setdefault(label, {})[scenario] = asdict(one)
    told: dict[str, object] = {
        "name": asked.name,
        "files": [str(file) for file in files],
        "observers": by_label,
        "entries": [asdict(entry) for entry in entries],
    }
    return dict(json_value(told))
