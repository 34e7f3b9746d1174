"""From the measured values of a job to verdicts."""

from __future__ import annotations

from hgorun.reproduce.job import Outcome, Work
from hgorun.result.records.status import STATUSES
from hgorun.study.study import Study
from hgorun.study.verdict import Verdict, judge


def verdicts_of(work: Work, outcome: Outcome) -> list[Verdict]:
    """The verdict on each claim measured, in the order of the file."""
    return [
        judge(claim, outcome.values[claim.id], _lost(work.study, i, outcome), work.study.drawn(i))
        for i, claim in enumerate(work.study.claims)
        if claim.id in outcome.values
    ]


def _lost(study: Study, claim: int, outcome: Outcome) -> list[str]:
    """What is not ok with the observers that a claim is about, in words."""
    asked = dict.fromkeys(of for quantity in study.quantities(claim) for of in quantity.of)
    return [
        f"run {run}, {words}"
        for run, label in asked
        for words in outcome.troubles.get(run, ())
        if words.startswith((f"observer {label}: ", *(f"observer {label} {status}" for status in STATUSES)))
    ]
