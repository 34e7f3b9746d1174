"""``figures``: the ``figures:`` blocks of the shipped experiments and of your own files."""

from __future__ import annotations

import json as json_text
import sys
from collections.abc import Mapping
from typing import TypedDict

from hgorun.commands.catalogue_options import Figures
from hgorun.commands.inputs import own_first
from hgorun.commands.outputs import refuse_other_kinds, refuse_unwritable
from hgorun.files import json_value
from hgorun.reproduce import pool
from hgorun.reproduce.choice import choose
from hgorun.reproduce.job import Folders, Outcome, Work


def figures(options: Figures) -> int:
    """Draw the chosen figures, all by default; with ``report`` measure the claims too and write the report."""
    folders = Folders.below(options.output)
    refuse_other_kinds(options.output, (), default=folders.figures)
    refuse_unwritable(folders.runs, kind="folder")
    names, report = own_first(options.names, "figures"), options.report
    works = choose(names, folders, figures=True, claims=report, width=options.width, style=options.style)
    reasons = [work.stale_figures for work in works]
    outcomes = pool.run_all(works, workers=options.jobs, show=options.text)
    rows = [row for made in zip(works, outcomes, reasons, strict=True) for row in _rows(*made)]
    for work, outcome in zip(works, outcomes, strict=True):
        warn(work, outcome)
    if options.report:
        from hgorun.reproduce.report import write_report

        written = write_report(works, outcomes, folders)
    if options.json:
        print(json_text.dumps(json_value(rows), indent=2, allow_nan=False))
    elif not options.quiet:
        for row in rows:
            print(_line(row))
        if options.report:
            print(f"written: {written}")
    return 0


class _Row(TypedDict):
    """A figure; its reason says why it was drawn, None that it stood."""

    figure: str
    experiment: str
    publication: str
    files: list[str]
    integration_error: float | None
    reason: str | None


def _line(row: _Row) -> str:
    error, reason = row["integration_error"], row["reason"]
    notes = [f"integration error {error:.1e}"] if error else []
    notes += [f"drawn: {reason}"] if reason else []
    return f"{row['figure']}: {row['files'][0]}" + (f" ({'; '.join(notes)})" if notes else "")


def _rows(work: Work, outcome: Outcome, reasons: Mapping[str, str]) -> list[_Row]:
    """One record a figure."""
    found: list[_Row] = []
    for name, files in outcome.figures.items():
        errors = [outcome.errors.get(run) for run in work.study.runs_of(name)]
        known = [e for e in errors if e is not None]
        found.append(
            {
                "figure": name,
                "experiment": work.study.name,
                "publication": work.job.group,
                "files": files,
                "integration_error": max(known) if known else None,
                "reason": reasons.get(name),
            }
        )
    return found


def warn(work: Work, outcome: Outcome) -> None:
    """What is not ok and missing lines of theory are reported on stderr; they are not errors."""
    for run, troubles in outcome.troubles.items():
        for words in troubles:
            print(f"hgorun: {work.study.name}: {run}: {words}", file=sys.stderr)
    for figure, refused in outcome.refused.items():
        for words in refused:
            print(f"hgorun: {work.study.name}: figure {figure}: {words}", file=sys.stderr)
