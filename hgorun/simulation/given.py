"""The error of a run whose step or tolerances are given, from a second pass that is made when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hgorun.errors import SimulationError
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import SlidingMode
from hgorun.result.data import PLANT
from hgorun.simulation.error_estimate import differences
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.measured import Measured, measured
from hgorun.simulation.passes import Pass, as_given, fixed_steps, integrate, part_of_error
from hgorun.simulation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun

_UNEVEN, _FEWEST, _MORE = 0.62, 0.125, 1.62  # steps of the second pass, for each of the first
_CHEAP = 1.5e6  # steps times states of a second pass that costs little beside the rest of the process
_PLAIN = 1e-3  # errors above this are worth a second pass that is nearer to the first
_LOOSER = 10.0  # times the tolerances


@dataclass(frozen=True, eq=False)
class LaterEstimate:
    """The errors of a run, estimated when called.

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

    def __call__(self) -> Mapping[str, float]:
        run = prepare(self.run) if isinstance(self.run, Experiment) else self.run
        how = as_given(run)
        labels = [PLANT, *(b.label for b in run.observers if not isinstance(b.observer, SlidingMode))]
        if not _integrates(run):
            return dict.fromkeys(labels, 0.0)
        errors = self._adaptive(run, how) if how.tolerance else self._fixed(run, how)
        return {label: errors[label] for label in labels}

    def _adaptive(self, run: PreparedRun, how: Pass) -> Mapping[str, float]:
        assert how.tolerance is not None
        factor = 1 / _LOOSER if self.finer else _LOOSER
        control = replace(how.tolerance, rtol=factor * how.tolerance.rtol, atol=factor * how.tolerance.atol)
        return self._error(run, replace(how, tolerance=control))

    def _fixed(self, run: PreparedRun, how: Pass) -> Mapping[str, float]:
        if not self.finer:
            work = float(np.sum(fixed_steps(run, how.step))) * run.structure.system.states
            fewest = float(np.clip(_CHEAP / work, _FEWEST, _UNEVEN))
            for ratio in dict.fromkeys((fewest, _UNEVEN)):
                errors = self._error(run, replace(how, uneven=ratio))
                if max(errors.values()) <= _PLAIN:
                    return errors
            if np.isfinite(max(errors.values())):
                return errors
        return self._error(run, replace(how, uneven=_MORE))

    def _error(self, run: PreparedRun, other: Pass) -> Mapping[str, float]:
        """From the second pass; infinite where it cannot be finished."""
        try:
            beside = measured(run, integrate(run, other))
        except SimulationError:
            return dict.fromkeys([PLANT, *self.found.estimates], np.inf)
        part = 1.0 if other.tolerance else part_of_error(run, other)
        return {label: part * gap for label, gap in differences(run, self.found, beside).items()}


def _integrates(run: PreparedRun) -> bool:
    """Whether there is anything between the samples that steps could be too long for."""
    continuous = any(isinstance(b.observer, ContinuousObserver) for b in run.observers)
    return continuous or not run.plant.block.discretise
