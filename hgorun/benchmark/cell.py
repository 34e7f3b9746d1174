"""One plant in one scenario: which observers take it, with what gain each is best, and how good it is then.

The score of a run is the error relative to the plant's own swing, over all states and the whole run,

    score = sqrt(mean_i (rmse_i / s_i)^2),    s_i the standard deviation of x_i along the run,

so that speed and noise both count: a low gain forgets its first error late, a high one passes the noise on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.config.benchmark import Contestant, Knob, Seeds, Tries
from hgorun.ensemble.block import compute
from hgorun.ensemble.found import Block
from hgorun.ensemble.members import Members
from hgorun.errors import ConfigError, HgorunError
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.preparation import prepare
from hgorun.simulation.simulate import simulate

Floats = NDArray[np.float64]
Told = Callable[[int], None]
_PART = 3  # of a run: its first third is the transient, the rest is steady
_FOLLOWED = 5  # seeds whose trajectories are looked at


@dataclass(frozen=True, eq=False)
class Score:
    """What a contestant reaches with its best gain, on seeds that have not been used for finding it.

    Attributes
    ----------
    value : float
        Of the knob.
    at_end : bool
        Whether it is at an end of its range, beyond which better values may lie.
    total, transient, steady : tuple of float
        For each seed the error relative to the swing: over the whole run, its first third, and the rest.
    peak : float
        The largest error of the first third, of any state, relative to its swing; median over the seeds.
    converged : float
        When the error, over some of the seeds and all states, has first come down to twice its steady size.
    lost : int
        Seeds with which the estimate was lost.
    tried : tuple of (float, float, float)
        Values of the knob that were tried with all seeds of tuning, their mean transient and steady errors.
    """

    value: float
    at_end: bool
    total: tuple[float, ...]
    transient: tuple[float, ...]
    steady: tuple[float, ...]
    peak: float
    converged: float
    lost: int
    tried: tuple[tuple[float, float, float], ...]


@dataclass(eq=False)
class Cell:
    """A plant in a scenario.

    Attributes
    ----------
    base : Experiment
        With one observer, whose initial estimate all contestants get.
    rate : float
        Of the plant, 1/time.
    contestants : mapping of str to Contestant
    seeds : Seeds
    tries : Tries
    threads : int
    told : callable
        Called with the number of runs that are finished.
    """

    base: Experiment
    rate: float
    contestants: Mapping[str, Contestant]
    seeds: Seeds
    tries: Tries
    threads: int = 1
    told: Told = lambda _: None
    refused: dict[str, str] = field(init=False, default_factory=dict)
    done: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.scale = _swing(self.base)
        self.taking = {label: one for label, one in self.contestants.items() if self._takes(label, one)}
        if self.taking:
            self.all = self._with(self.taking)

    @property
    def runs(self) -> int:
        """How many runs it takes."""
        return 2 * ((self.tries.coarse + self.tries.fine) * self.seeds.tuning + self.seeds.scoring) + _FOLLOWED

    def scores(self) -> dict[str, Score]:
        """Of every contestant that takes the plant.

        Raises
        ------
        HgorunError
            When none does.
        """
        if not self.taking:
            raise HgorunError(f"{self.base.name}: no observer takes this plant: {'; '.join(self.refused.values())}")
        tuning = self._seeds(self.seeds.first, self.seeds.tuning)
        scans = {label: _Scan(one.knob, self.rate) for label, one in self.taking.items()}
        for points in ({label: scan.coarse(self.tries.coarse) for label, scan in scans.items()},):
            self._try(scans, points, tuning)
        self._try(scans, {label: scan.around_best(self.tries.fine) for label, scan in scans.items()}, tuning)
        best = {label: scan.best for label, scan in scans.items()}
        scoring = self._seeds(self.seeds.first + self.seeds.tuning, self.seeds.scoring)
        found = self._measured({label: np.array([value]) for label, value in best.items()}, scoring)
        quiet = self._converged(best)
        return {
            label: Score(
                value=best[label],
                at_end=scans[label].at_end,
                total=_listed(found.total[:, j]),
                transient=_listed(found.transient[:, j]),
                steady=_listed(found.steady[:, j]),
                peak=float(np.median(found.peak[:, j])),
                converged=quiet[j],
                lost=int(np.sum(~np.isfinite(found.total[:, j]))),
                tried=scans[label].means(),
            )
            for j, label in enumerate(self.taking)
        }

    def _try(self, scans: Mapping[str, _Scan], points: Mapping[str, Floats], seeds: NDArray[np.int64]) -> None:
        found = self._measured(points, seeds)
        for j, (label, scan) in enumerate(scans.items()):
            shape = points[label].size, seeds.size
            scan.add(points[label], *(part[:, j].reshape(shape) for part in (found.total, found.transient, found.steady)))

    def _seeds(self, first: int, count: int) -> NDArray[np.int64]:
        return first + np.arange(count)

    def _takes(self, label: str, one: Contestant) -> bool:
        """Whether a contestant takes the plant and what is measured of it; why not is kept."""
        try:
            prepare(self._with({label: one}))
        except ConfigError as error:
            self.refused[label] = error.message
            return False
        return True

    def _with(self, contestants: Mapping[str, Contestant]) -> Experiment:
        """The base with contestants, whose knobs are in the middle of their ranges."""
        (reference,) = self.base.observers.items()
        initial = dict(reference[1].initial)
        changes: dict[str, Any] = {f"observers.{reference[0]}": None} if reference[0] not in contestants else {}
        for label, one in contestants.items():
            middle = _Scan(one.knob, self.rate).coarse(3)[1]
            changes[f"observers.{label}"] = {**one.block, "initial": initial, one.knob.key: _as_key(one.knob, middle)}
        return self.base.varied(changes)

    def _measured(self, points: Mapping[str, Floats], seeds: NDArray[np.int64]) -> _Measured:
        """What is measured at points of every knob, for all seeds at each; the fastest index is that of the seeds."""
        count = max(values.size for values in points.values())
        columns: dict[str, Any] = {"seed": np.tile(seeds, count)}
        for label, values in points.items():
            knob = self.taking[label].knob
            filled = np.concatenate([values, np.full(count - values.size, values[-1])])
            columns[f"observers.{label}.{knob.key}"] = _column(knob, np.repeat(filled, seeds.size))
        start, end = self.all.blocks.time.start, self.all.blocks.time.end
        middle = start + (end - start) / _PART
        windows = {"metrics.window": [middle, end], "metrics.transient": [start, middle]}
        steady = self._block(self.all.varied(windows), columns, ("rmse", "peak"))
        whole = self._block(self.all.varied({**windows, "metrics.window": [start, end]}), columns, ("rmse",))
        total, late = self._size(whole.metrics["rmse"]), self._size(steady.metrics["rmse"])
        with np.errstate(invalid="ignore"):
            early = np.sqrt(np.maximum(_PART * total**2 - (_PART - 1) * late**2, 0.0))
        peak = np.max(steady.metrics["peak"] / self.scale, axis=2)
        return _Measured(total, np.where(np.isfinite(total), early, np.inf), late, peak)

    def _block(self, base: Experiment, columns: Mapping[str, Any], metrics: Sequence[str]) -> Block:
        before = self.done
        found = compute(
            base,
            Members.of(columns),
            metrics=metrics,
            threads=self.threads,
            progress=lambda done: self.told(before + done),
        )
        self.done = before + len(found.error)
        if any(found.error):
            raise HgorunError(f"{self.base.name}: {next(filter(None, found.error))}")
        return found

    def _size(self, rmse: Floats) -> Floats:
        """The error relative to the swing, of all states together."""
        return np.asarray(np.sqrt(np.mean((rmse / self.scale) ** 2, axis=2)))

    def _converged(self, best: Mapping[str, float]) -> list[float]:
        """When the error, over some seeds and all states, has first come down to twice its steady size."""
        knobs = {
            f"observers.{label}.{one.knob.key}": _as_key(one.knob, best[label]) for label, one in self.taking.items()
        }
        tuned = self.all.varied(knobs)
        squares = []
        for seed in self._seeds(self.seeds.first + self.seeds.tuning, _FOLLOWED).tolist():
            run = simulate(tuned.varied({}, seed=seed))
            squares.append([np.mean((run.observers[label].error / self.scale) ** 2, axis=1) for label in self.taking])
            self.done += 1
            self.told(self.done)
        sizes = np.sqrt(np.mean(squares, axis=0))
        late = run.time >= run.time[0] + (run.time[-1] - run.time[0]) / _PART
        return [_first_below(run.time, size, 2 * float(np.sqrt(np.mean(size[late] ** 2)))) for size in sizes]


@dataclass(frozen=True, eq=False)
class _Measured:
    """Errors of members (N, m)."""

    total: Floats
    transient: Floats
    steady: Floats
    peak: Floats


@dataclass(eq=False)
class _Scan:
    """What has been tried of a knob."""

    knob: Knob
    rate: float
    values: Floats = field(default_factory=lambda: np.empty(0))
    errors: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def _ends(self) -> Floats:
        return np.array(self.knob.range.ends) * (self.rate if self.knob.rate else 1.0)

    def coarse(self, count: int) -> Floats:
        """Values all over the range."""
        low, high = self._ends()
        return self._valid(np.geomspace(low, high, count) if self.knob.range.log else np.linspace(low, high, count))

    def around_best(self, count: int) -> Floats:
        """Values between the neighbours of the best one so far."""
        order = np.argsort(self.values)
        at = int(np.flatnonzero(order == self._best)[0])
        low, high = (self.values[order[int(np.clip(at + d, 0, order.size - 1))]] for d in (-1, 1))
        between = np.geomspace(low, high, count + 2) if self.knob.range.log else np.linspace(low, high, count + 2)
        return self._valid(between[1:-1])

    def _valid(self, values: Floats) -> Floats:
        return np.unique(np.round(values)) if self.knob.whole else values

    def add(self, values: Floats, total: Floats, transient: Floats, steady: Floats) -> None:
        """Errors at values, for every seed; an estimate that is lost with any seed is not wanted."""
        means = np.column_stack([part.mean(axis=1) for part in (total, transient, steady)])
        self.values, self.errors = np.concatenate([self.values, values]), np.vstack([self.errors, means])

    @property
    def _best(self) -> int:
        return int(np.argmin(self.errors[:, 0]))

    @property
    def best(self) -> float:
        """The value with the smallest mean error over the whole run."""
        return float(self.values[self._best])

    @property
    def at_end(self) -> bool:
        """Whether it is the first or the last value."""
        return self.best in (self.values.min(), self.values.max())

    def means(self) -> tuple[tuple[float, float, float], ...]:
        """Values in ascending order, with transient and steady errors."""
        order = np.argsort(self.values)
        return tuple((float(self.values[i]), float(self.errors[i, 1]), float(self.errors[i, 2])) for i in order)


def _as_key(knob: Knob, value: float) -> float | int:
    return round(value) if knob.whole else float(value)


def _column(knob: Knob, values: Floats) -> Any:
    return values.astype(int) if knob.whole else values


def _listed(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _swing(base: Experiment) -> Floats:
    """The standard deviation of each state along the run; of a state that rests, its size."""
    x = simulate(base).x
    rests = np.maximum(np.abs(x).max(axis=0), np.finfo(float).tiny)
    spread: Floats = x.std(axis=0)
    return np.where(spread > 1e-6 * rests, spread, rests)


def _first_below(time: Floats, size: Floats, level: float) -> float:
    """How long after the start a size is first at most a level; the whole time where it never is."""
    below = np.flatnonzero(size <= level)
    return float((time[below[0]] if below.size else time[-1]) - time[0])


def blocks_of(contestants: Mapping[str, Contestant]) -> Iterator[tuple[str, dict[str, Any]]]:
    """What a cell's numbers follow from, of each contestant."""
    for label, one in contestants.items():
        yield label, one.model_dump(mode="json")
