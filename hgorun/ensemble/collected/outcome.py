"""How many members of a collected file have which status."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.errors import printable
from hgorun.result.records.data import PLANT
from hgorun.result.records.status import STATUSES

_SHOWN = 400  # characters of a member's error
_REASONS = 3  # that are said
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Outcome:
    """What has become of the members of an ensemble.

    Attributes
    ----------
    name : str
    members, failed : int
        How many there are, and how many could not be carried out.
    observers : mapping of str to mapping of str to int
        For every observer how many members have which status, without those that none has.
    status : str
        The worst of them.
    lost : mapping of str to str
        For every observer that is lost in some members, the earliest time at which it is: ``t=1.25 s``.
    reasons : tuple of (int, str)
        The first member that has failed, and its error; then the first ones whose error differs in more than numbers.
    largest_error : mapping of str to float
        See :func:`largest_of_ok`.
    """

    name: str
    members: int
    failed: int
    observers: Mapping[str, Mapping[str, int]]
    status: str
    lost: Mapping[str, str]
    reasons: tuple[tuple[int, str], ...]
    largest_error: Mapping[str, float]

    @property
    def nothing(self) -> bool:
        """Whether no member could be carried out."""
        return self.failed == self.members

    def text(self) -> str:
        """In a line for every observer."""
        lines = [f"{printable(self.name)}: {self.members} members"]
        width = max(map(len, self.observers), default=0)
        for label, counts in self.observers.items():
            lines.append(f"  {printable(label):<{width}}  " + ", ".join(f"{n} {word}" for word, n in counts.items()))
        return "\n".join(lines)

    def troubles(self, where: Callable[[int, str], str] = lambda number, error: error) -> Iterator[str]:
        """What is not ok, in words.

        Parameters
        ----------
        where : callable
            From the number of a member and its error to the error with its place in a file.
        """
        for label, counts in self.observers.items():
            words = [f"{n} {word}" for word, n in counts.items() if word not in ("ok", "failed")]
            if words:
                since = f", the earliest at {self.lost[label]}" if label in self.lost else ""
                yield f"observer {printable(label)}: of {self.members} members {', '.join(words)}{since}"
        for k, (number, error) in enumerate(self.reasons):
            told = where(number, error)[:_SHOWN]
            counted = f"{self.failed} of {self.members} members failed; the first is member {number}"
            yield f"{f'member {number} for another reason' if k else counted}: {told}"


def outcome_of(path: Path) -> Outcome:
    """Count the members of a file that this program has just written."""
    with h5py.File(path, "r") as file:
        status = file["status"][()].reshape(file["plant_status"].size, -1)
        labels = file["observer"].asstr()[()]
        failed = np.flatnonzero(file["plant_status"][()].ravel() == STATUSES.index("failed"))
        errors = file["error"]
        reasons, count = dict[str, tuple[int, str]](), 0
        for number in failed:
            text = errors.asstr()[np.unravel_index(number, errors.shape)]
            if text:
                count += 1
                if len(reasons) < _REASONS:
                    reasons.setdefault(_NUMBER.sub("", text), (int(number), printable(text)))
        since = file["status_at"][()].reshape(status.shape)
        since[(status != STATUSES.index("diverged")) & (status != STATUSES.index("undefined"))] = np.nan
        unit = printable(str(file["status_at"].attrs.get("units", "")))
        lost = {
            str(label): f"t={np.nanmin(since[:, j]):.6g} {unit}".rstrip()
            for j, label in enumerate(labels)
            if np.isfinite(since[:, j]).any()
        }
        counts = {str(label): _counted(status[:, j]) for j, label in enumerate(labels)}
        name, worst = str(file.attrs["name"]), str(file.attrs["status"])
        own = file["integration_error"][()].reshape(status.shape)
        integration = np.column_stack([file["plant_integration_error"][()].ravel(), own])
    largest = largest_of_ok([*counts], integration, status)
    return Outcome(name, len(status), count, counts, worst, lost, tuple(reasons.values()), largest)


def largest_of_ok(observers: Sequence[str], errors: NDArray[np.float64], status: NDArray[np.int8]) -> dict[str, float]:
    """The largest integration errors among members that are ok, where one is known.

    Parameters
    ----------
    observers : sequence of str
    errors : ndarray, shape (N, 1 + m)
        Of the plant and of the observers; NaN where none is known. No rows where nothing is.
    status : ndarray, shape (N, m)

    Returns
    -------
    dict of str to float
        Of the plant, in members with an observer that is ok, and of observers.
    """
    if not errors.size:
        return {}
    ok = status == STATUSES.index("ok")
    of_ok = np.where(np.column_stack([ok.any(axis=1), ok]), errors, np.nan)
    largest = np.fmax.reduce(of_ok, axis=0).tolist()
    return {name: error for name, error in zip((PLANT, *observers), largest, strict=True) if not math.isnan(error)}


def _counted(status: NDArray[np.int8]) -> dict[str, int]:
    """How many there are of every word that occurs."""
    counts = np.bincount(status, minlength=len(STATUSES)).tolist()
    return {word: count for word, count in zip(STATUSES, counts, strict=True) if count}
