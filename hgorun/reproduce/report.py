"""The report of a reproduction: verdicts, figures, errata, versions, as Markdown with small pictures."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from hgorun.files import write_text, written_whole
from hgorun.reproduce.job import Folders, Outcome, Work
from hgorun.reproduce.publications import Publication, publication
from hgorun.reproduce.shipped import folder as shipped_folder
from hgorun.reproduce.verdicts import verdicts_of
from hgorun.study.verdict import VERDICTS, Verdict
from hgorun.version import __version__

_PACKAGES = ("numpy", "scipy", "casadi", "llvmlite", "matplotlib", "h5py")
_HEAD = """# Reproduction report

All figures of the publications, drawn again; a verdict on every claim that their texts make about the figures; and the
errors found in the printed formulas. This report is written by `make figures`, which runs

    hgorun figures --report

The parameters of each figure, and what the publications leave open, are in the experiment named below it. A claim is
confirmed or refuted by an inequality between numbers from the runs. If the runs are random, the number is the mean over
the seeds given, with its 95 % confidence interval; a claim whose interval contains the threshold is undecided. If a
publication does not say what decides, such as a horizon, the claim has alternatives, shown after "or"; if some of them
confirm the claim and others refute it, the verdict is "depends". A statement about a limit, which no finite run can
decide, is undecidable. Errata are errors in the printed text; what is undecided, or kept as printed, is listed
separately and not counted.
"""


def write_report(works: Sequence[Work], outcomes: Sequence[Outcome], folders: Folders) -> Path:
    """Write REPORT.md and its pictures.

    Returns
    -------
    Path
        Of REPORT.md.
    """
    groups: dict[str, list[tuple[Work, Outcome]]] = {}
    for work, outcome in zip(works, outcomes, strict=True):
        groups.setdefault(work.job.group, []).append((work, outcome))
    known = {group: publication(shipped_folder() / group) for group in groups}
    lines = [_HEAD, *_summary(groups, known)]
    for group, made in groups.items():
        lines += ["", f"## {known[group].short}", "", known[group].title, *_claims(made)]
        lines += _figures(group, made, folders)
        lines += _errata(known[group])
    lines += ["", "## Versions", "", *_versions(), ""]
    path = folders.report / "REPORT.md"
    write_text(path, "\n".join(lines))
    return path


def _verdicts(made: Sequence[tuple[Work, Outcome]]) -> list[Verdict]:
    """In the order of their numbers."""

    def order(verdict: Verdict) -> tuple[int, str]:
        number = re.match(r"\d+", verdict.claim.id)
        return (int(number[0]) if number else 10**6, verdict.claim.id)

    return sorted((v for work, outcome in made for v in verdicts_of(work, outcome)), key=order)


def _summary(groups: dict[str, list[tuple[Work, Outcome]]], known: dict[str, Publication]) -> Iterator[str]:
    yield f"| publication | figures | claims | {' | '.join(VERDICTS)} | errata | undecided or kept |"
    yield "|" + "---|" * (5 + len(VERDICTS))
    for group, made in groups.items():
        verdicts = _verdicts(made)
        counts = [sum(v.verdict == kind for v in verdicts) for kind in VERDICTS]
        figures = sum(len(outcome.figures) for _, outcome in made)
        errata = [len(known[group].errors), len(known[group].doubts)]
        cells = [known[group].short, figures, len(verdicts), *counts, *errata]
        yield "| " + " | ".join(map(str, cells)) + " |"


def _claims(made: Sequence[tuple[Work, Outcome]]) -> Iterator[str]:
    verdicts = _verdicts(made)
    if not verdicts:
        return
    yield from ("", "### Claims", "", "| | claim | stated in | measured | verdict |", "|---|---|---|---|---|")
    for v in verdicts:
        note = "".join(f" *{words.strip()}*" for words in (v.reason, v.claim.note) if words)
        expressions = [f" `{one.inequality.value}`" for one in v.measured] or [""]
        number = "; ".join(text + expression for text, expression in zip(v.texts, expressions, strict=True))
        verdict = f"**{v.verdict}**" + (f" (expected: {v.claim.expected})" if v.surprising else "")
        yield _row(v.claim.id, f"{v.claim.claim}{note}", v.claim.source, number, verdict)


def _row(*cells: str) -> str:
    return "| " + " | ".join(" ".join(cell.split()).replace("|", r"\|") for cell in cells) + " |"


def _figures(group: str, made: Sequence[tuple[Work, Outcome]], folders: Folders) -> Iterator[str]:
    if any(outcome.figures for _, outcome in made):
        yield from ("", "### Figures")
    verdicts = _verdicts(made)  # of all files: a figure's claims may need runs that are not in it
    for work, outcome in made:
        for name in outcome.figures:
            small = folders.report / "report" / group / f"{name}.png"
            _copy(Path(outcome.small[name]), small)
            title = " ".join((work.study.figures[name].title or "").split())
            errors = [outcome.errors.get(run) for run in work.study.runs_of(name)]
            known = [e for e in errors if e is not None]
            error = f", integration error {max(known):.0e}" if known else ""
            yield from ("", f"**{name}** {title}", "", f"![{name}]({small.relative_to(folders.report).as_posix()})")
            told = [f"{v.claim.id} {v.verdict}" for v in verdicts if v.claim.figure == name]
            claims = f"; claims: {', '.join(told)}" if told else ""
            yield from ("", f"`{work.job.place}`{error}{claims}")


def _errata(known: Publication) -> Iterator[str]:
    if known.errors:
        yield from ("", "### Errata", "", "| place | printed | right | evidence |", "|---|---|---|---|")
        yield from (_row(e.place, e.printed, e.right, e.evidence) for e in known.errors)
    if known.doubts:
        yield from ("", "### Undecided, or kept as printed", "")
        yield from ("| | place | printed | what is used | why |", "|---|---|---|---|---|")
        yield from (_row(e.kind, e.place, e.printed, e.right, e.evidence) for e in known.doubts)


def _versions() -> Iterator[str]:
    packages = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    yield f"hgorun {__version__}, Python {platform.python_version()}, {packages}, {platform.machine()}."


def _copy(source: Path, target: Path) -> None:
    """A copy of a picture, where there is none or another one."""
    content = source.read_bytes()
    if not target.is_file() or target.read_bytes() != content:
        with written_whole(target) as part:
            part.write_bytes(content)
