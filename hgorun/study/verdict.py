"""Whether a claim holds, by its number and the uncertainty of that number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.config.models import Claim
from hgorun.files import json_value

CONFIRMED, REFUTED, UNDECIDED = "confirmed", "refuted", "undecided"
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Verdict:
    """A claim with its number.

    Attributes
    ----------
    verdict : str
        confirmed, refuted, or undecided where the interval holds the threshold.
    value : float
        The mean over members of an ensemble.
    interval : (low, high) or None
        95 % confidence interval of the mean (Student's t); None where nothing is random.
    members : int
        How many values the mean is of.
    """

    claim: Claim
    verdict: str
    value: float
    interval: tuple[float, float] | None
    members: int

    @property
    def as_expected(self) -> bool:
        """Whether it is the verdict that the file states."""
        return self.verdict == self.claim.expect

    @property
    def threshold(self) -> tuple[str, float | list[float]]:
        """The relation and its threshold."""
        claim = self.claim
        if claim.between is not None:
            return "between", list(claim.between)
        return ("<", claim.below) if claim.below is not None else (">", claim.above or 0.0)

    def as_json(self) -> dict[str, Any]:
        """As JSON holds it; numbers that are not finite are text."""
        relation, threshold = self.threshold
        return {
            "id": self.claim.id,
            "claim": self.claim.claim,
            "source": self.claim.source,
            "figure": self.claim.figure,
            "verdict": self.verdict,
            "value": json_value(self.value),
            "interval": json_value(self.interval),
            "relation": relation,
            "threshold": threshold,
            "expression": self.claim.value,
            "members": self.members,
            "expected": self.claim.expect,
            "note": self.claim.note,
        }


def judge(claim: Claim, values: Sequence[float]) -> Verdict:
    """The verdict on a claim from one value, or from those of the members of an ensemble."""
    value = float(np.mean(values))
    if len(values) == 1:
        holds = _holds(claim, value)
        verdict = UNDECIDED if math.isnan(value) else CONFIRMED if holds else REFUTED
        return Verdict(claim, verdict, value, None, 1)
    interval = _interval(np.asarray(values))
    inside = [_holds(claim, end) for end in interval]
    if any(map(math.isnan, interval)):
        verdict = UNDECIDED
    elif all(inside):
        verdict = CONFIRMED
    else:
        verdict = UNDECIDED if _touches(claim, interval) else REFUTED
    return Verdict(claim, verdict, value, interval, len(values))


def _holds(claim: Claim, value: float) -> bool:
    if claim.between is not None:
        return claim.between[0] <= value <= claim.between[1]
    return value < claim.below if claim.below is not None else value > (claim.above or 0.0)


def _touches(claim: Claim, interval: tuple[float, float]) -> bool:
    """Whether some of the interval satisfies the inequality."""
    low, high = claim.between or (
        (-math.inf, claim.below) if claim.below is not None else (claim.above or 0.0, math.inf)
    )
    return interval[0] < high and interval[1] > low


def _interval(values: np.ndarray) -> tuple[float, float]:
    from scipy.special import stdtrit

    mean, n = float(np.mean(values)), values.size
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2) * np.std(values, ddof=1) / math.sqrt(n))
    return mean - half, mean + half


def number_text(verdict: Verdict) -> str:
    """The number and its threshold: ``0.0123 (< 0.2 is claimed)``, with the interval where there is one."""
    relation, threshold = verdict.threshold
    value = f"{verdict.value:.4g}"
    if verdict.interval is not None:
        low, high = verdict.interval
        value += f" [{low:.4g}, {high:.4g}] of {verdict.members}"
    if isinstance(threshold, list):
        return f"{value} ({threshold[0]:g} to {threshold[1]:g} is claimed)"
    return f"{value} ({relation} {threshold:g} is claimed)"
