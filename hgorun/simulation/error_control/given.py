"""The error of a run whose step or tolerances are given, from a second pass that is made when it is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hgorun.errors import SimulationError
from hgorun.observers.base import ContinuousObserver
from hgorun.result.records.data import PLANT, IntegrationError
from hgorun.simulation.divergence.confirmation import ended
from hgorun.simulation.error_control.error_estimate import differences
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.outcome.measured import Measured, measured
from hgorun.simulation.passes.passes import Pass, as_given, fixed_steps, integrate, part_of_error
from hgorun.simulation.preparation.preparation import needs_given_steps, prepare
from hgorun.simulation.prepared import PreparedRun

_UNEVEN, _FEWEST, _MORE = 0.62, 0.125, 1.62  # steps of the second pass, for each of the first
_CHEAP = 1.5e6  # steps times states of a second pass that costs little beside the rest of the process
_PLAIN = 1e-3  # errors above this are worth a second pass that is nearer to the first
_LOOSER = 10.0  # times the tolerances


@dataclass(frozen=True, eq=False, repr=False)
class LaterEstimate:
    """The errors of a run, estimated when called: of the plant, and of the observers that are not lost.

    Attributes
    ----------
    run : PreparedRun or Experiment
        The experiment alone, once the estimate has been copied or sent to another process.
    found : Measured
        What the run has given.
    finer : bool
        Whether the second pass has shorter steps, which takes longer and tells more.
    """

    run: PreparedRun | Experiment
    found: Measured
    finer: bool = False

    def __getstate__(self) -> dict[str, Any]:
        run = self.run if isinstance(self.run, Experiment) else self.run.experiment
        return self.__dict__ | {"run": run}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def __call__(self) -> IntegrationError:
        run = prepare(self.run) if isinstance(self.run, Experiment) else self.run
        how = as_given(run)
        if not _integrates(run):
            return IntegrationError(dict.fromkeys(self._labels(run), 0.0))
        how = replace(how, bounded=False)  # the others come back from wherever they are
        return self._adaptive(run, how) if how.tolerance else self._fixed(run, how)

    def _adaptive(self, run: PreparedRun, how: Pass) -> IntegrationError:
        assert how.tolerance is not None
        factor = 1 / _LOOSER if self.finer else _LOOSER
        given = how.tolerance
        control = replace(given, rtol=factor * given.rtol, atol=None if given.atol is None else factor * given.atol)
        return self._error(run, replace(how, tolerance=control))

    def _fixed(self, run: PreparedRun, how: Pass) -> IntegrationError:
        if not self.finer:
            work = float(fixed_steps(run, how.step).total) * run.structure.system.states
            fewest = float(np.clip(_CHEAP / work, _FEWEST, _UNEVEN))
            for ratio in dict.fromkeys((fewest, _UNEVEN)):
                errors = self._error(run, replace(how, uneven=ratio))
                if max(errors.relative.values()) <= _PLAIN:
                    return errors
            if np.isfinite(max(errors.relative.values())):
                return errors
        return self._error(run, replace(how, uneven=_MORE))

    def _error(self, run: PreparedRun, other: Pass) -> IntegrationError:
        """From the second pass; infinite where it cannot be finished."""
        try:
            beside = measured(run, *ended(run, integrate(run, other)))
        except SimulationError:
            return IntegrationError(dict.fromkeys(self._labels(run), np.inf))
        part = 1.0 if other.tolerance else part_of_error(run, other)
        return differences(run, self.found, beside).error(part, self._labels(run), run.plant.model.states)

    def _labels(self, run: PreparedRun) -> list[str]:
        """Of what there are errors: of the plant, and of observers that have numbers and a limit."""
        observers = enumerate(run.observers)
        limited = [(j, b.label) for j, b in observers if not needs_given_steps(run.experiment, b.observer)]
        return [PLANT, *(label for j, label in limited if np.all(np.isfinite(self.found.estimates.of(j))))]


def _integrates(run: PreparedRun) -> bool:
    """Whether there is anything between the samples that steps could be too long for."""
    continuous = any(isinstance(b.observer, ContinuousObserver) for b in run.observers)
    return continuous or not run.plant.block.discretise
