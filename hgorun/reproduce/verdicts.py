"""From the measured values of a job to verdicts."""

from __future__ import annotations

from hgorun.reproduce.job import Outcome, Work
from hgorun.study.verdict import Verdict, judge


def verdicts_of(work: Work, outcome: Outcome) -> list[Verdict]:
    """The verdict on each claim measured, in the order of the file."""
    return [judge(claim, outcome.values[claim.id]) for claim in work.study.claims if claim.id in outcome.values]
