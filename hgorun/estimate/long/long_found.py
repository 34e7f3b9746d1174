"""What is seen on the way through a long log, stretch by stretch, and told at its end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.estimate.carrying import ORDER, UNEVEN, note_difference, relative_error
from hgorun.estimate.scores.compared import Compared, Key
from hgorun.estimate.scores.lag import Instrument
from hgorun.result.records.recorded import RecordedOutput
from hgorun.simulation.timeline.steps import part_of_difference
from hgorun.symbolic.evaluate import Floats

_SHOWN = 10_000  # points, and samples of an output, that are kept for a picture


@dataclass(kw_only=True, eq=False, repr=False)
class Sweep:
    """What has been seen of one way through a log.

    Attributes
    ----------
    z, w : ndarray
        The states and what is held at the end of the last stretch.
    diverged : ndarray, shape (m,)
        When each observer has.
    largest : float
        What the bound follows from there.
    tries : int
        Steps.
    """

    z: Floats
    w: Floats | None
    diverged: Floats
    largest: float = 1.0
    tries: int = 0


@dataclass(kw_only=True, eq=False, repr=False)
class Found:
    """What is told at the end of a log.

    Attributes
    ----------
    compared : mapping of Key to list of Compared
        Stretch by stretch.
    instruments : mapping of Key to Instrument
        Those that lag, of what is compared.
    sizes, gaps : ndarray, shape (m, n)
        The largest estimates, and differences to the other steps.
    undefined : ndarray, shape (m,)
        From when on an estimate is no number.
    by_steps : ndarray of bool, shape (m,)
        Which observers are lost since the steps are too long for them, as far as they have been compared.
    shown : dict of str to list of ndarray
        By data set, every so many of its rows, stretch by stretch.
    steps : set of int
        How many there are between two events.
    done : dict
        How far all that is asked for has been told.
    comparisons : int
        With the other steps, so far.
    """

    compared: dict[Key, list[Compared]]
    instruments: dict[Key, Instrument]
    sizes: Floats
    gaps: Floats
    undefined: Floats
    by_steps: np.ndarray
    shown: dict[str, list[np.ndarray]] = field(default_factory=dict)
    steps: set[int] = field(default_factory=set)
    done: dict[object, int] = field(default_factory=dict)
    comparisons: int = 0

    def all_shown(self, path: str) -> np.ndarray:
        """Of a data set the rows that are shown."""
        return np.concatenate(self.shown[path])

    @classmethod
    def begin(cls, m: int, n: int, keys: Iterable[Key], instruments: dict[Key, Instrument]) -> Found:
        """Nothing has been seen yet, of m observers and n states."""
        return cls(
            compared={key: [] for key in keys},
            instruments=instruments,
            sizes=np.zeros((m, n)),
            gaps=np.zeros((m, n)),
            undefined=np.full(m, np.inf),
            by_steps=np.zeros(m, dtype=bool),
        )

    def keep(self, path: str, rows: np.ndarray, total: int) -> None:
        """Of rows that a data set is given, keep those that are shown; it gets a total."""
        every, first = -(-total // _SHOWN), self.done.get(path, 0)
        self.done[path] = first + len(rows)
        self.shown.setdefault(path, []).append(rows[-first % every :: every].copy())

    def samples(self, output: str, clock: str) -> RecordedOutput:
        """Those of an output that are shown; with another one, or itself, it shares its times."""
        taken = self.all_shown(f"measurement/{clock}/time")
        y, innovation = (self.all_shown(f"measurement/{output}/{name}") for name in ("y", "innovation"))
        used, nis = np.ones(innovation.shape, dtype=bool), np.full(innovation.shape, np.nan)
        return RecordedOutput(taken, taken, y, used, innovation, nis)

    def compare(self, own: Sequence[Floats], other: Sequence[Floats]) -> None:
        """Note how far the estimates of every observer, (n_t, n) each, are from those with other steps."""
        self.comparisons += 1
        with np.errstate(invalid="ignore"):
            for j, (a, b) in enumerate(zip(own, other, strict=True)):
                if len(a):
                    note_difference(self.sizes[j], self.gaps[j], a, b)

    def error(self, method: str) -> Floats:
        """Of every observer, as far as it has been compared."""
        part = part_of_difference(np.array(sorted(self.steps)), UNEVEN, min(METHODS[method].order, ORDER))
        return relative_error(part, self.sizes, self.gaps)


def together(parts: Sequence[Compared]) -> Compared:
    """What is compared in all stretches."""
    return Compared(
        parts[0].name,
        np.concatenate([part.taken for part in parts]),
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.residuals for part in parts], axis=1),
    )
