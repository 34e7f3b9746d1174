"""What is said of a run and of each of its observers: a word, a time, a reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, get_args

Status = Literal["ok", "inaccurate", "diverged", "undefined", "failed"]
STATUSES: tuple[Status, ...] = get_args(Status)  # the worst last
_WITHOUT_NUMBERS = ("diverged", "undefined", "failed")


@dataclass(frozen=True)
class Verdict:
    """Whether numbers can be trusted, and why not.

    Attributes
    ----------
    status : str
        ``ok``; ``inaccurate``: the integration error is larger than it should be; ``diverged``: the estimate has left
        the truth for good; ``undefined``: the estimate is not a number; ``failed``: the run could not be finished.
    at : float or None
        The time from which on it is so, where there is one.
    reason : str or None
        Why, where it is known: a sentence without a full stop.
    """

    status: Status = "ok"
    at: float | None = None
    reason: str | None = None

    @property
    def lost(self) -> bool:
        """Whether there are no numbers from that time on."""
        return self.status in _WITHOUT_NUMBERS

    def since(self, origin: float) -> Verdict:
        """The same, its time counted from some time on."""
        return self if self.at is None else replace(self, at=self.at - origin)

    def text(self, unit: str = "") -> str:
        """The word, and the time where there is one: ``diverged at t=1.25 s``."""
        return self.status if self.at is None else f"{self.status} at t={self.at:.6g} {unit}".rstrip()

    def sentence(self, unit: str = "") -> str:
        """The same with the reason."""
        return self.text(unit) + ("" if self.reason is None else f": {self.reason}")


OK = Verdict()


def worst(verdicts: Iterable[Verdict]) -> Status:
    """The worst word; ``ok`` where there is none."""
    return max((verdict.status for verdict in verdicts), key=STATUSES.index, default="ok")
