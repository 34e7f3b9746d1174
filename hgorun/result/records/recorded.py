"""What a result of recorded data has beside trajectories: the samples, and what is said of them without a truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hgorun.config.named import Named, name_keys

WIDE = 1.959963984540054  # standard deviations to either side that hold 95 % of normal numbers


@dataclass(frozen=True, eq=False, repr=False)
class RecordedOutput:
    """The recorded samples of one output, in the order of their arrival, and what the m observers made of them.

    Attributes
    ----------
    taken, available, y : ndarray, shape (N,)
        The time it was measured, the time it was known, the value.
    used : ndarray of bool, shape (N, m)
        False for outliers, and for what came after a newer sample.
    innovation : ndarray, shape (N, m)
        y minus what was estimated, before the sample was used.
    nis : ndarray, shape (N, m)
        The innovation squared over its variance, of observers that know that; NaN otherwise.
    """

    taken: np.ndarray
    available: np.ndarray
    y: np.ndarray
    used: np.ndarray
    innovation: np.ndarray
    nis: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Unseen:
    """Measurements that no observer was given.

    Attributes
    ----------
    taken, y : ndarray, shape (N,)
    """

    taken: np.ndarray
    y: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Recorded:
    """What an estimate has been made of.

    Attributes
    ----------
    outputs : mapping of str to RecordedOutput
    held_out : mapping of str to Unseen
        By output, samples that were set aside.
    reference : mapping of str to Unseen
        By state or output, what was measured for comparison alone.
    time_origin : str
        The date and time of day at time 0 (ISO 8601, with Z in UTC), where the log has dates; else empty.
    """

    outputs: Mapping[str, RecordedOutput]
    held_out: Mapping[str, Unseen] = field(default_factory=dict)
    reference: Mapping[str, Unseen] = field(default_factory=dict)
    time_origin: str = ""

    def __post_init__(self) -> None:
        name_keys(
            self,
            outputs="output",
            held_out="output with held-out samples",
            reference="state or output of the reference",
        )


@dataclass(frozen=True)
class InARow:
    """The most samples of an output that a gate has left out one after the other, in the order of its judgements.

    Attributes
    ----------
    count : int
    first, last : float
        When the first and the last of them were taken.
    """

    count: int
    first: float
    last: float


@dataclass(frozen=True, eq=False, repr=False)
class Assessed:
    """What is said of an estimate where no truth is known.

    Attributes
    ----------
    lower, upper : ndarray, shape (Nt, n)
        A band of 95 %: of Kalman filters one that should hold the true state, of others one that should hold what is
        measured, with its noise; NaN where there is none.
    no_band : mapping of str to str
        By state, why it has none.
    scores : mapping of str to mapping
        By score, then by output, state or gain.
    in_a_row : mapping of str to InARow
        By output of which a gate has left samples out; a file has none.
    outliers_at_start : mapping of str to int
        By output how many of these the start has found to be outliers beside the others; a file has none.
    """

    lower: np.ndarray
    upper: np.ndarray
    no_band: Mapping[str, str]
    scores: Mapping[str, Mapping[str, float]]
    in_a_row: Mapping[str, InARow] = field(default_factory=dict)
    outliers_at_start: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        scores = {score: Named(of, f"entry of {score}") for score, of in self.scores.items()}
        object.__setattr__(self, "scores", Named(scores, "score"))
        name_keys(self, no_band="state without a band")
