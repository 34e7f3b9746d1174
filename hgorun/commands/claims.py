"""``claims``: what the publications say, measured."""

from __future__ import annotations

import json as json_text
from collections.abc import Iterator, Sequence

from hgorun.commands.catalogue_options import Claims
from hgorun.commands.figures import warn
from hgorun.commands.inputs import own_first
from hgorun.commands.outputs import refuse_other_kinds, refuse_unwritable
from hgorun.reproduce import pool
from hgorun.reproduce.choice import choose
from hgorun.reproduce.job import Folders, Work
from hgorun.reproduce.verdicts import verdicts_of
from hgorun.study.verdict import VERDICTS, Verdict
from hgorun.tables.layout import wrapped

UNEXPECTED = 3


def claims(options: Claims) -> int:
    """Measure the chosen claims, all by default."""
    refuse_other_kinds(options.output, ())
    names, folders = own_first(options.names, "claims"), Folders.below(options.output)
    refuse_unwritable(folders.runs, kind="folder")
    works = choose(names, folders, figures=False, claims=True, seed=options.seed)
    outcomes = pool.run_all(works, workers=options.jobs, show=options.text)
    found: list[tuple[Work, Verdict]] = []
    for work, outcome in zip(works, outcomes, strict=True):
        warn(work, outcome)
        found += [(work, verdict) for verdict in verdicts_of(work, outcome)]
    if options.json:
        rows = [
            {"publication": work.job.group, "experiment": work.study.name, **v.as_json(), "seed": _seed(work)}
            for work, v in found
        ]
        print(json_text.dumps(rows, indent=2, allow_nan=False))
    elif not options.quiet:
        print(_text(found))
    return UNEXPECTED if options.strict and not all(v.as_expected for _, v in found) else 0


def _seed(work: Work) -> int:
    """Of its runs; where they have several seeds, the first of them."""
    return next(iter(work.study.runs.values())).seeds[0]


def _expressions(verdict: Verdict, others: Sequence[str]) -> Iterator[str]:
    """What the number is the value of, then the alternatives, with theirs where they have expressions of their own."""
    own = [one.inequality.value for one in verdict.measured]
    if own:
        yield f"value: {own[0]}"
    for text, expression in zip(others, own[1:], strict=True):
        yield text if expression == own[0] else f"{text}; value: {expression}"


def _text(found: Sequence[tuple[Work, Verdict]]) -> str:
    lines: list[str] = []
    last = ""
    for work, verdict in found:
        group = work.job.group
        if group != last:
            lines += ["", group] if last else [group]
            last = group
        surprise = "" if not verdict.surprising else f"  (expected: {verdict.claim.expected})"
        first, *others = verdict.texts
        lines += wrapped(f"{verdict.claim.id:>4}  {verdict.verdict:<11}  {first}{surprise}", "  ", then=" " * 8)
        for words in (verdict.claim.claim, *_expressions(verdict, others), verdict.reason):
            lines += wrapped(words, " " * 8)
    counts = {kind: sum(v.verdict == kind for _, v in found) for kind in VERDICTS}
    unexpected = sum(v.surprising for _, v in found)
    summary = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    surprises = f"; {unexpected} not as expected" if unexpected else ""
    lines += ["", *wrapped(f"{len(found)} claims: {summary}{surprises}")]
    return "\n".join(lines)
