"""A block of members: their metrics and statuses as arrays, without trajectories."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.members import Members
from hgorun.errors import ConfigError, HgorunError
from hgorun.result.data import PLANT
from hgorun.result.metrics.base import all_metrics
from hgorun.result.result import Result
from hgorun.result.status import STATUSES
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.simulate import simulate

Floats = NDArray[np.float64]
FAILED = STATUSES.index("failed")


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """What became of the members of an ensemble, N of them with m observers of a plant of n states.

    Attributes
    ----------
    observers, states : tuple of str
        Labels and names, in the order of the arrays.
    metrics : mapping of str to ndarray, shape (N, m, n)
        Infinite where an estimate is lost or a member has failed.
    status : ndarray of int8, shape (N, m)
        Places in :data:`hgorun.result.status.STATUSES`: ok, inaccurate, diverged, undefined, failed.
    status_at, diverged_at : ndarray, shape (N, m)
        The time that the status is about, and that of divergence; NaN without one.
    reason : ndarray of text, shape (N, m)
        Why the status is not ok; empty where nothing is said.
    plant_status : ndarray of int8, shape (N,)
        Of the plant's own numbers: ok, inaccurate or failed.
    error : ndarray of text, shape (N,)
        Why a member has failed; empty where it has not.
    method : ndarray of text, shape (N,)
        Of integration; empty where a member has failed.
    step, rtol : ndarray, shape (N,)
        The longest fixed step, or the relative tolerance of controlled ones; NaN where there is none.
    evaluations : ndarray of int64, shape (N,)
        Of the right-hand side.
    integration_error : ndarray, shape (N, 1 + m)
        Of the plant and of every observer, where the step was found by error control; NaN where none was estimated.
    """

    observers: tuple[str, ...]
    states: tuple[str, ...]
    metrics: Mapping[str, Floats]
    status: NDArray[np.int8]
    status_at: Floats
    diverged_at: Floats
    reason: NDArray[np.object_]
    plant_status: NDArray[np.int8]
    error: NDArray[np.object_]
    method: NDArray[np.object_]
    step: Floats
    rtol: Floats
    evaluations: NDArray[np.int64]
    integration_error: Floats

    def __len__(self) -> int:
        return int(self.status.shape[0])

    @classmethod
    def empty(cls, base: Experiment, size: int, metrics: Sequence[str]) -> Block:
        """A block of members that have all failed so far, to be filled in."""
        observers, states = tuple(base.observers), base.plant.model.states
        m = len(observers)
        return cls(
            observers=observers,
            states=states,
            metrics={name: np.full((size, m, len(states)), np.inf) for name in metrics},
            status=np.full((size, m), FAILED, dtype=np.int8),
            status_at=np.full((size, m), np.nan),
            diverged_at=np.full((size, m), np.nan),
            reason=np.full((size, m), "", dtype=object),
            plant_status=np.full(size, FAILED, dtype=np.int8),
            error=np.full(size, "", dtype=object),
            method=np.full(size, "", dtype=object),
            step=np.full(size, np.nan),
            rtol=np.full(size, np.nan),
            evaluations=np.zeros(size, dtype=np.int64),
            integration_error=np.full((size, 1 + m), np.nan),
        )

    def record(self, i: int, result: Result) -> None:
        """Write down the result of member i."""
        for j, label in enumerate(self.observers):
            one = result.observers[label]
            for name, values in self.metrics.items():
                values[i, j] = one.metrics[name]
            self.status[i, j] = STATUSES.index(one.status)
            self.status_at[i, j] = np.nan if one.status_at is None else one.status_at
            self.diverged_at[i, j] = np.nan if one.diverged_at is None else one.diverged_at
            self.reason[i, j] = one.reason or ""
        self.plant_status[i] = STATUSES.index(result.verdict.status)
        how = result.integration
        assert how is not None  # of a run that has just been carried out
        self.method[i] = how.method
        self.step[i] = np.nan if how.step is None else how.step
        self.rtol[i] = np.nan if how.rtol is None else how.rtol
        self.evaluations[i] = how.evaluations or 0
        if not callable(how.error):  # else it takes a second pass
            self.integration_error[i] = [how.error.get(label, np.nan) for label in (PLANT, *self.observers)]


def compute(
    base: Experiment,
    members: Members,
    *,
    metrics: Sequence[str] = (),
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Block:
    """Carry out members of an ensemble and keep their metrics, each with the bits of the member alone.

    Parameters
    ----------
    base : Experiment
    members : Members
        What each of them changes.
    metrics : sequence of str
        The names of those that are kept; all that are known where none is given.
    threads : int
        How many carry members out side by side.
    progress : callable, optional
        Called with the number of members that are finished.

    Returns
    -------
    Block
        A member that cannot be carried out is recorded with its message, and does not stop the others.

    Raises
    ------
    ConfigError
        For an unknown metric, and for a path ``observers.*`` that no observer has.
    """
    block = Block.empty(base, len(members), _known(metrics))
    members = members.of_observers(base)
    _one_by_one(base, members, range(len(members)), block, progress)
    return block


def _one_by_one(
    base: Experiment,
    members: Members,
    which: Iterable[int],
    block: Block,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Members that are run alone."""
    for done, i in enumerate(which, start=1):
        try:
            block.record(i, simulate(base.varied(members.changes(i))))
        except Exception as error:  # whatever it is, the others go on
            block.error[i] = failure(error)
        if progress is not None:
            progress(done)


def failure(error: Exception) -> str:
    """What is recorded of a member that has failed."""
    return str(error) if isinstance(error, HgorunError) else f"{type(error).__name__}: {error}"


def _known(metrics: Sequence[str]) -> tuple[str, ...]:
    known = all_metrics()
    for name in metrics:
        if name not in known:
            raise ConfigError(f"no metric is called {name!r}; known: {', '.join(known)}", key="metrics")
    return tuple(metrics) or tuple(known)
