"""What an observer knows of its own errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.estimate.samples import stated
from hgorun.observers.kalman import KalmanFilter
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.readout import Readout
from hgorun.simulation.system.structure import Structure
from hgorun.symbolic.evaluate import Floats, evaluate


@dataclass(frozen=True, eq=False, repr=False)
class Covariance:
    """P of a Kalman filter, and the variance of its innovations.

    Attributes
    ----------
    p : ndarray
        The parameters of the run.
    noise : ndarray, shape (q,)
        Variance of a sample of each output; NaN where it is not known.
    """

    block: ObserverBlock
    spread: Readout
    p: Floats
    noise: Floats

    @classmethod
    def of(cls, experiment: Experiment, structure: Structure, p: Floats, block: ObserverBlock) -> Covariance | None:
        """None of an observer that has none."""
        labels = [b.label for b in structure.observers]
        spread = structure.spreads[labels.index(block.label)]
        if spread is None:
            return None
        known, outputs = stated(experiment), experiment.plant.model.outputs
        noise = np.array([known.get(name, np.nan) ** 2 for name in outputs])
        observer = block.observer
        if isinstance(observer, KalmanFilter) and observer.of_samples:
            given = np.asarray(block.design["R"], dtype=float)
            noise = np.where(given > 0, given, noise)
        return cls(block, spread, p, noise)

    def deviation(self, rows: Floats) -> Floats:
        """Standard deviation of the errors, shape (N, n), from all states, shape (N, states)."""
        P = self.block.states["P"].shaped(rows)
        return np.asarray(np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0)))

    def variance(self, times: Floats, rows: Floats, held: Floats) -> Floats:
        """Of the innovations of every output, shape (N, q).

        Parameters
        ----------
        times : ndarray, shape (N,)
        rows : ndarray, shape (N, states)
        held : ndarray, shape (N, held numbers) or (held numbers,)
            What is held, of which inputs matter.
        """
        return np.asarray(self._expected(times, rows, held)[:, : self.noise.size] + self.noise)

    def offset(self, times: Floats, rows: Floats, held: Floats) -> Floats:
        """What the observer expects samples to be, less C xhat, shape (N, q); arguments as of :meth:`variance`."""
        return self._expected(times, rows, held)[:, self.noise.size :]

    def _expected(self, times: Floats, rows: Floats, held: Floats) -> Floats:
        return np.asarray(evaluate(self.spread.function, times[:, None], self.p, rows, held)[0])
