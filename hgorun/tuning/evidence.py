"""The front on seeds that the search has not seen: the numbers that are reported, and how sure the front is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.ensemble.statistics.inference import interval
from hgorun.measurement.chance import generator
from hgorun.tuning.search import Found
from hgorun.tuning.task import Floats, Task
from hgorun.tuning.trials import measured

_SHOWN = 12  # points of a front that are tried again
_RESAMPLED = 1000  # times, for the confidence


@dataclass(frozen=True, eq=False)
class Evidence:
    """What has become of a task.

    Attributes
    ----------
    task : Task
    found : Found
    front : ndarray of int, shape (F,)
        Candidates of the front that have been tried again, ordered by the first goal.
    gains : ndarray, shape (F, k)
        Theirs, with so many digits as are written.
    held_out : ndarray, shape (F, H, q)
        Goals and limits on the held-out seeds; infinite where an estimate was lost.
    confidence : ndarray, shape (F,)
        In which part of the resampled held-out seeds no other point of the front beats it.
    chosen : int
        The place of the knee, or of the minimum.
    """

    task: Task
    found: Found
    front: NDArray[np.int64]
    gains: Floats
    held_out: Floats
    confidence: Floats
    chosen: int

    @property
    def tuned(self) -> dict[str, float]:
        """The gains chosen, by path."""
        return dict(zip((gain.path for gain in self.task.gains), self.gains[self.chosen].tolist(), strict=True))

    def mean(self, *, held_out: bool) -> tuple[Floats, Floats]:
        """Means of goals and limits over seeds, and half the widths of their 95 % intervals, (F, q) each."""
        values = self.held_out if held_out else self.found.trials.values[self.front]
        with np.errstate(invalid="ignore"):
            mean = values.mean(axis=1)
            n = values.shape[1]
            sem = np.full_like(mean, np.nan) if n < 2 else values.std(axis=1, ddof=1) / np.sqrt(n)
        low, high = interval(0.0 * sem, sem, n)
        return mean, (high - low) / 2


def evidence(found: Found, threads: int = 1) -> Evidence:
    """Try the points of a front with the held-out seeds."""
    task = found.trials.task
    places = _shown(len(found.front), found.chosen)
    front = found.front[places]
    gains = np.vectorize(_written, otypes=[float])(found.trials.gains[front])
    seeds = np.array(task.held_out)
    flat = measured(task, np.repeat(gains, len(seeds), axis=0), np.tile(seeds, len(front)), threads)
    held_out = flat.reshape(len(front), len(seeds), -1)
    chosen = int(np.flatnonzero(places == found.chosen)[0])
    confidence = _confidence(held_out[:, :, : len(task.goals)], task)
    return Evidence(task, found, front, gains, held_out, confidence, chosen)


def _shown(count: int, chosen: int) -> NDArray[np.int64]:
    """Which points of a front are tried again: both ends, the chosen one and others between, evenly."""
    if count <= _SHOWN:
        return np.arange(count)
    places = np.linspace(0, count - 1, _SHOWN).round().astype(np.int64)
    if chosen not in places:
        places[1 + np.argmin(np.abs(places[1:-1] - chosen))] = chosen
    return places


def _written(value: float) -> float:
    """A gain with six digits: more are of no account."""
    return float(f"{value:.6g}")


def _confidence(goals: Floats, task: Task) -> Floats:
    """How often each point stays on the front when the seeds are drawn anew, with replacement."""
    points, seeds, _ = goals.shape
    random = generator(task.seeds[0], "tune", "confidence")
    drawn = random.integers(seeds, size=(_RESAMPLED, seeds))
    stays = np.zeros(points)
    for draw in drawn:
        stays += non_dominated(goals[:, draw].mean(axis=1))
    return stays / _RESAMPLED
