"""What is exported of an observer: its operations, where its numbers lie, and how its outputs reach it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.engine.early import Early
from hgorun.engine.layout import Held
from hgorun.engine.methods import Method
from hgorun.export.equations import Output, compares
from hgorun.export.names import identifier
from hgorun.export.operations import Operations
from hgorun.observers.base import ContinuousObserver, CorrectedObserver
from hgorun.plants.build import BuiltPlant
from hgorun.result.records.status import Verdict
from hgorun.simulation.design.design import Design
from hgorun.simulation.system.observer_block import ObserverBlock


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Exported:
    """An observer with all its numbers, ready to be written in another language.

    Attributes
    ----------
    run, label : str
        Names of the run and of the observer.
    design : Design
    block : ObserverBlock
        Its equations, in symbols of its own; its states lie in z from 0 on.
    plant : BuiltPlant
    outputs : tuple of Output
    told : tuple of int
        The inputs that are told to it; others are the configuration's functions of time.
    start : ndarray, shape (size,)
        z at the start.
    begun : mapping of str to str
        By state, how its initial estimate was found in a log: ``sample`` or ``model``.
    method : Method
    step : float
        The longest step.
    early : Early
        Where steps close behind the start end, whenever a prediction is asked for.
    beside : tuple of str
        The other exported observers, where one step was found that all of them need.
    pieces : int
        Steps of history that are kept.
    sides : bool
        Whether functions of time have kinks or jumps: at the ends of a prediction they are evaluated inside of it.
    origin : float
        The start of the run on the clock of the configuration.
    gap : float
        The longest time between two events of the run.
    usual_gap : float
        The median of these times.
    unit : str
        Of time.
    equations : Operations
        rate(t, z, w) and what else is evaluated between samples; w as :attr:`places` says.
    jump : Operations or None
        What z becomes at a sample, with w of the engine's layout :attr:`held`.
    verdict : callable
        What becomes of it in the run, with times on the clock of the configuration; the run is carried out for it
        unless its steps have been found so.
    """

    run: str
    label: str
    design: Design
    block: ObserverBlock
    plant: BuiltPlant
    outputs: tuple[Output, ...]
    told: tuple[int, ...]
    start: np.ndarray
    begun: Mapping[str, str]
    method: Method
    step: float
    early: Early
    beside: tuple[str, ...]
    pieces: int
    sides: bool
    origin: float
    gap: float
    usual_gap: float
    unit: str
    equations: Operations
    jump: Operations | None
    held: Held
    verdict: Callable[[], Verdict]

    @property
    def name(self) -> str:
        """The label as a name of C."""
        return identifier(self.label)

    @property
    def size(self) -> int:
        """Numbers in z."""
        return self.block.end

    @property
    def alpha(self) -> int | None:
        """Where alpha begins in z; None where the observer does not compare with the past."""
        return self.block.states["alpha"].start if "alpha" in self.block.states else None

    @property
    def flows(self) -> bool:
        """Whether it moves between the samples."""
        return isinstance(self.block.observer, ContinuousObserver)

    @property
    def compares(self) -> bool:
        """Whether it is driven by the one innovation between samples."""
        return compares(self.block.observer)

    @property
    def corrected(self) -> bool:
        """Whether it jumps at samples of any of its outputs; others that jump need all outputs at once."""
        return isinstance(self.block.observer, CorrectedObserver)

    @property
    def joins(self) -> bool:
        """Whether samples of several outputs correct it together, also when they are told one after the other."""
        return self.corrected and sum(output.sampled for output in self.outputs) > 1

    @cached_property
    def period(self) -> float | None:
        """The period of which samples have to be whole multiples apart; None where their times do not matter."""
        observer = self.design.observer
        return observer.whole_periods(self.design.form) if isinstance(observer, CorrectedObserver) else None

    @property
    def clocks(self) -> bool:
        """Whether it keeps when the last sample was."""
        return self.period is not None or (self.jump is not None and not self.corrected)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs that are told to it."""
        return tuple(self.plant.model.inputs[i] for i in self.told)

    @property
    def states(self) -> tuple[str, ...]:
        """Of the plant."""
        return self.plant.model.states

    @property
    def remembered(self) -> tuple[int, ...]:
        """The outputs with a history."""
        return tuple(i for i, output in enumerate(self.outputs) if output.remembered)

    @property
    def sampled(self) -> bool:
        """Whether some output is sampled."""
        return any(output.sampled for output in self.outputs)

    @property
    def continuous(self) -> bool:
        """Whether some output is continuous."""
        return any(output.continuous for output in self.outputs)

    @cached_property
    def places(self) -> tuple[tuple[str, int], ...]:
        """What stands in w of the equations, entry by entry: an array and the place in it."""
        m, q = len(self.inputs), len(self.outputs)
        parts = (("u", m), ("du", m), ("e", q), ("dz", self.size))
        return tuple((name, k) for name, count in parts for k in range(count))
