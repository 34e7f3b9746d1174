"""Whether a claim holds, by its numbers and their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hgorun.config.study import Claim, Inequality
from hgorun.files import json_value

CONFIRMED, REFUTED, UNDECIDED, UNDECIDABLE, DEPENDS = VERDICTS = (
    "confirmed",
    "refuted",
    "undecided",
    "undecidable",
    "depends",
)
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Measured:
    """An inequality with its number.

    Attributes
    ----------
    inequality : Inequality
    verdict : str
        confirmed, refuted, undecided where the interval holds the threshold, or undecidable where there is no number,
        or one that is infinite by some members only and does not refute it.
    value : float
        The mean over members of an ensemble.
    interval : (low, high) or None
        95 % confidence interval of the mean (Student's t); None where nothing is random or the mean is not finite.
    members : int
        How many values the mean is of.
    drawn : bool
        Whether random numbers decide it; of one member, those of one seed.
    """

    inequality: Inequality
    verdict: str
    value: float
    interval: tuple[float, float] | None
    members: int
    drawn: bool = False

    @property
    def threshold(self) -> tuple[str, float | list[float]]:
        """The relation and its threshold."""
        one = self.inequality
        if one.between is not None:
            return "between", list(one.between)
        return ("<", one.below) if one.below is not None else (">", one.above or 0.0)

    @property
    def text(self) -> str:
        """The number and its threshold: ``0.0123 (< 0.2 is claimed)``, with the interval where there is one."""
        relation, threshold = self.threshold
        value = f"{self.value:.4g}"
        if self.interval is not None:
            low, high = self.interval
            value += f" [{low:.4g}, {high:.4g}]"
        if self.members > 1:
            value += f" of {self.members}"
        elif self.drawn:
            value += " of one seed"
        if isinstance(threshold, list):
            return f"{value} ({threshold[0]:g} to {threshold[1]:g} is claimed)"
        return f"{value} ({relation} {threshold:g} is claimed)"

    def as_json(self) -> dict[str, Any]:
        """As JSON holds it; numbers that are not finite are text."""
        relation, threshold = self.threshold
        return {
            "value": json_value(self.value),
            "interval": json_value(self.interval),
            "relation": relation,
            "threshold": threshold,
            "expression": self.inequality.value,
            "members": self.members,
        }


_NOTHING = dict.fromkeys(("value", "interval", "relation", "threshold", "expression", "members"))


@dataclass(frozen=True)
class Verdict:
    """A claim with its numbers.

    Attributes
    ----------
    claim : Claim
    verdict : str
        confirmed, refuted or undecided by the claim's own inequality and all alternatives; depends, where some of
        them confirm it and others refute it; undecidable, where no finite run decides, or there is no number.
    measured : tuple of Measured
        The claim's own inequality, then the alternatives; nothing where it has no value.
    reason : str
        Why it is undecidable, where it is.
    """

    claim: Claim
    verdict: str
    measured: tuple[Measured, ...]
    reason: str = ""

    @property
    def as_expected(self) -> bool:
        """Whether it is the verdict that the file states, or confirmed where it states none."""
        return self.verdict == self.claim.expected

    @property
    def surprising(self) -> bool:
        """Whether the file states another one; without ``expect`` it states none."""
        stated = bool(self.claim.undecidable) or "expect" in self.claim.model_fields_set
        return stated and not self.as_expected

    @property
    def texts(self) -> list[str]:
        """A line for every number; of alternatives with their own verdicts and what they choose."""
        if not self.measured:
            return ["not measured"]
        first, *others = self.measured
        lines = [first.text]
        for one, alternative in zip(others, self.claim.alternatives, strict=True):
            note = f": {alternative.note}" if alternative.note else ""
            lines.append(f"or {one.text}, {one.verdict}{note}")
        return lines

    def as_json(self) -> dict[str, Any]:
        """As JSON holds it; numbers that are not finite are text."""
        first, *others = [one.as_json() for one in self.measured] or [_NOTHING]
        alternatives = [
            {**values, "verdict": one.verdict, "note": alternative.note}
            for values, one, alternative in zip(others, self.measured[1:], self.claim.alternatives, strict=True)
        ]
        return {
            "id": self.claim.id,
            "claim": self.claim.claim,
            "source": self.claim.source,
            "figure": self.claim.figure,
            "verdict": self.verdict,
            **first,
            "alternatives": alternatives,
            "undecidable": self.reason or None,
            "expected": self.claim.expected,
            "note": self.claim.note,
        }


def judge(
    claim: Claim, values: Sequence[Sequence[float]], lost: Sequence[str] = (), drawn: Sequence[bool] = ()
) -> Verdict:
    """The verdict on a claim.

    Parameters
    ----------
    claim : Claim
    values : sequence of sequence of float
        Of its own inequality, then of the alternatives: one value each, or those of the members of an ensemble. NaN
        where there is none.
    lost : sequence of str
        In words, which observers that it is about have diverged.
    drawn : sequence of bool
        Of each, whether random numbers decide it; nothing where none does.
    """
    random = drawn or [False] * len(values)
    each = zip(claim.inequalities, values, random, strict=True)
    measured = tuple(replace(measure(one, numbers), drawn=by_chance) for one, numbers, by_chance in each)
    if claim.undecidable:
        return Verdict(claim, UNDECIDABLE, measured, claim.undecidable)
    verdict = _together({m.verdict for m in measured})
    if verdict != UNDECIDABLE:
        return Verdict(claim, verdict, measured)
    first = next(m for m in measured if m.verdict == UNDECIDABLE)
    missing = sum(not math.isfinite(number) for number in values[measured.index(first)])
    return Verdict(claim, verdict, measured, _why(claim, first.members, missing, lost))


def _why(claim: Claim, members: int, missing: int, lost: Sequence[str]) -> str:
    because = "; ".join(lost) or "an observer diverged, a divisor is 0 or a quantity is not defined"
    if claim.divergence:
        return f"{missing} of its {members} numbers are not finite, neither all nor none: {because}."
    what = "It has no number" if members == 1 else f"{missing} of its {members} numbers are missing"
    return f"{what}: {because}. If the claim is that an observer diverges, say `divergence: true`."


def _together(verdicts: set[str]) -> str:
    if {CONFIRMED, REFUTED} <= verdicts:
        return DEPENDS
    return next((word for word in (UNDECIDABLE, UNDECIDED) if word in verdicts), "") or verdicts.pop()


def measure(inequality: Inequality, values: Sequence[float]) -> Measured:
    """Whether an inequality holds, by one value or by those of the members of an ensemble."""
    value = float(np.mean(values))
    if len(values) == 1:
        verdict = CONFIRMED if inequality.holds(value) else REFUTED
        return Measured(inequality, UNDECIDABLE if math.isnan(value) else verdict, value, None, 1)
    if not math.isfinite(value):
        return Measured(inequality, _without_bound(inequality, value, set(values)), value, None, len(values))
    interval = _interval(np.asarray(values))
    if all(inequality.holds(end) for end in interval):
        verdict = CONFIRMED
    else:
        verdict = UNDECIDED if _touches(inequality, interval) else REFUTED
    return Measured(inequality, verdict, value, interval, len(values))


def _without_bound(inequality: Inequality, mean: float, values: set[float]) -> str:
    """By a mean that is infinite, or not a number.

    One infinite error makes the mean infinite, and that is not below a number; that it is above one takes all.
    """
    alike = len(values) == 1
    if math.isnan(mean) or (not alike and (mean < 0 or inequality.holds(mean))):
        return UNDECIDABLE
    return CONFIRMED if inequality.holds(mean) else REFUTED


def _touches(one: Inequality, interval: tuple[float, float]) -> bool:
    """Whether some of the interval satisfies the inequality."""
    low, high = one.between or ((-math.inf, one.below) if one.below is not None else (one.above or 0.0, math.inf))
    return interval[0] < high and interval[1] > low


def _interval(values: np.ndarray) -> tuple[float, float]:
    from scipy.special import stdtrit

    mean, n = float(np.mean(values)), values.size
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2) * np.std(values, ddof=1) / math.sqrt(n))
    return mean - half, mean + half
