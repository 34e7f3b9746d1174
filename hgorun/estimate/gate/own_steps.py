"""Observers that step from sample to sample, each from the last one that it has taken.

What a step needs of the sample before is held once for all observers: its values, the time since then, the inputs then.
An observer to which that sample was an outlier makes its next step from an older one, as if there were none between.
Where all samples before were outliers, the next one is its first: it makes no step there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from hgorun.engine.layout import JUMP, NOTHING, SET, HybridSystem
from hgorun.engine.plan import Integers
from hgorun.errors import Problem
from hgorun.observers.base import SampledObserver
from hgorun.observers.sample_times import OnePeriod
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import Floats


def stepping(experiment: Experiment, labels: Iterable[str]) -> frozenset[int]:
    """The numbers of the observers that step from sample to sample, among some that samples may be left out for.

    Raises
    ------
    Problem
        For one whose step is that of one period.
    """
    for label, observer in experiment.observers.items():
        if isinstance(observer, OnePeriod):
            message = (
                f"the step of {observer.type} is that of one period, and a gate leaves samples out: give the outputs "
                "no gate, or run it apart; plausible: [low, high] leaves values out for all"
            )
            raise Problem(("observers", label, "type"), message)
    return frozenset(j for j, label in enumerate(labels) if isinstance(experiment.observers[label], SampledObserver))


@dataclass(frozen=True, slots=True)
class LastTaken:
    """The samples from which the next step of an observer goes on.

    Attributes
    ----------
    t : float
        When they were taken.
    y : tuple of float
        Of every output.
    u : tuple of float
        The inputs then, those that come with samples.
    """

    t: float
    y: tuple[float, ...]
    u: tuple[float, ...]

    def told(self) -> list[Any]:
        """For a checkpoint."""
        return [self.t, self.y, self.u]

    @classmethod
    def of(cls, told: Sequence[Any]) -> LastTaken:
        """From what :meth:`told` gave, read back from JSON."""
        t, y, u = told
        return cls(float(t), tuple(map(float, y)), tuple(map(float, u)))


@dataclass(eq=False, repr=False)
class OwnSteps:
    """From where the observers of a system go on that have left out the last samples.

    Attributes
    ----------
    system : HybridSystem
    outputs : range
        Those of the system from whose samples to the next the observers step.
    last : dict of int to LastTaken or None
        By the numbers of these observers; None where they have taken no sample yet.
    """

    system: HybridSystem
    outputs: range
    last: dict[int, LastTaken | None] = field(default_factory=dict)

    def leave_out(self, j: int, w: Floats, before: float | None) -> None:
        """An observer leaves out the samples that have just arrived.

        Parameters
        ----------
        w : ndarray
            What is held, after their step.
        before : float, optional
            When the samples before had been taken; None for the first ones.
        """
        if j in self.last:
            return
        if before is None:
            self.last[j] = None
            return
        held = self.system.held
        y = tuple([float(w[held.previous(i)]) for i in self.outputs])
        self.last[j] = LastTaken(before, y, tuple([float(w[place]) for place in self._inputs]))

    def take(self, j: int, actions: Integers, w: Floats, t: float) -> tuple[Integers, Floats]:
        """How an observer takes samples that arrive at t, after others that it has left out.

        Parameters
        ----------
        actions : ndarray of int
            The rows of the action table that happen to the others then.
        w : ndarray
            What is held to the others before.

        Returns
        -------
        actions, w : ndarray
            The same for this observer.
        """
        last, held, found, happening = self.last.pop(j), self.system.held, w.copy(), actions.copy()
        kind, which = happening[:, 0], happening[:, 1]
        if last is None:
            happening[(kind == JUMP) & (which < len(self.system.stepped)), 0] = NOTHING
            return happening, found
        found[[held.output(i) for i in self.outputs]] = last.y
        found[self._inputs] = last.u
        found[held.interval] = t - last.t
        happening[(kind == SET) & np.isin(which, [*self._inputs, held.interval]), 0] = NOTHING
        return happening, found

    @cached_property
    def _inputs(self) -> list[int]:
        """The places in w of the inputs at the sample before."""
        return [self.system.held.input(i)[3] for i in range(self.system.held.inputs)]
