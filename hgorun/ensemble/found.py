"""What became of the members of an ensemble: metrics and statuses as arrays, without trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.errors import HgorunError
from hgorun.result.records.data import PLANT
from hgorun.result.records.status import STATUSES
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
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
        Places in :data:`hgorun.result.records.status.STATUSES`: ok, inaccurate, diverged, undefined, failed.
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
    quantities : ndarray, shape (N, q)
        What else was asked for; infinite where a member has failed.
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
    quantities: Floats

    def __len__(self) -> int:
        return int(self.status.shape[0])

    @classmethod
    def empty(cls, base: Experiment, size: int, metrics: Sequence[str], quantities: int = 0) -> Block:
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
            quantities=np.full((size, quantities), np.inf),
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
            self.integration_error[i] = [how.error.relative.get(label, np.nan) for label in (PLANT, *self.observers)]

    def record_many(
        self,
        which: Integers,
        metrics: Mapping[str, Floats],
        *,
        method: str,
        step: float | None,
        rtol: float | None,
        evaluations: Integers,
        errors: Floats | None = None,
    ) -> None:
        """Write down several members of which nothing is to be said but that they are ok.

        Parameters
        ----------
        which : ndarray of int64, shape (K,)
        metrics : mapping of str to ndarray, shape (m, n, K)
        method, step, rtol, evaluations
            How they were integrated; with a step or with a tolerance.
        errors : ndarray, shape (1 + m, K), optional
            Of the plant and of the observers.
        """
        for name, values in self.metrics.items():
            values[which] = np.moveaxis(metrics[name], -1, 0)
        self.status[which] = self.plant_status[which] = STATUSES.index("ok")
        self.method[which], self.evaluations[which] = method, evaluations
        self.step[which], self.rtol[which] = (np.nan if one is None else one for one in (step, rtol))
        if errors is not None:
            self.integration_error[which] = errors.T

    def fail(self, i: int, error: Exception) -> None:
        """Write down that member i could not be carried out."""
        self.error[i] = str(error) if isinstance(error, HgorunError) else f"{type(error).__name__}: {error}"
