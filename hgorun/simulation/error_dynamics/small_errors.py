"""How small errors of an observer grow from sample to sample, with the gain in use and with any other one."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from hgorun.observers.capabilities import GainOfErrors, Speed
from hgorun.simulation.design.design import Design
from hgorun.simulation.error_dynamics.apart import Apart
from hgorun.simulation.error_dynamics.monodromy import exponentials, monodromy, on_their_way
from hgorun.simulation.error_dynamics.resting import at_rest
from hgorun.simulation.error_dynamics.slopes import at_truth, slopes
from hgorun.simulation.error_dynamics.timing import Timing
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.structure import parameter_values
from hgorun.symbolic.evaluate import Floats, evaluate

_POINTS = 3  # of the run
_FINE = 16  # samples a delay that stand for a continuous output, or for more of them

AnyTiming: TypeAlias = Timing | Apart


class SmallErrors:
    """The linearised error at points of the plant's way, with any gain."""

    def __init__(self, run: PreparedRun, block: ObserverBlock, x: Floats) -> None:
        self.run, self.block = run, block
        self._slopes, observer = slopes(run, block), block.observer
        roles = observer.roles(block.form)
        self._gains = [name for name in block.states if roles.get(name) == "gain"]
        e = observer.unhindered if isinstance(observer, GainOfErrors) else 0.0
        self._e = np.full(len(run.plant.model.outputs), e)
        self._rows = np.linspace(0, len(x) - 1, _POINTS).astype(int)
        self._x = x[self._rows]
        self._systems = self._at(run.numbers.p, block, run.experiment.designs[block.label])

    def with_value(self, key: str, value: float) -> SmallErrors:
        """The same error with another value of a key."""
        run, label = self.run, self.block.label
        observer = self.block.observer
        assert isinstance(observer, Speed)  # it has the key
        other = observer.at_speed(key, value)
        design = Design.of(label, other, self.block.form)
        designs = [design if b.label == label else run.experiment.designs[b.label] for b in run.observers]
        found = object.__new__(SmallErrors)
        found.__dict__ |= self.__dict__
        p = parameter_values(run.plant.everything, run.experiment.stretches, designs)
        found._systems = self._at(p, self.block.of(design), design)
        return found

    def growth(self, timing: AnyTiming) -> float:
        """The largest factor by which errors grow from sample to sample, at any of the points."""
        return float(np.max(self._radii(timing)))

    def smallest_growth(self, timing: AnyTiming) -> float:
        """The smallest of them."""
        return float(np.min(self._radii(timing)))

    def fastest(self) -> float:
        """The largest rate at which errors move where outputs are continuous, at any of the points."""
        G, H = self._systems
        n = H.shape[2]
        return float(np.max(np.abs(np.linalg.eigvals(G[:, :n, :n] + G[:, :n, n:] @ H))))

    def _at(self, p: Floats, block: ObserverBlock, design: Design) -> tuple[Floats, Floats]:
        """(xi, e)' = G (xi, e) between samples, and H, at the points; xi is without gains: they change no small error.

        Raises
        ------
        ValueError
            Where the observer's coordinates do not exist.
        Unsettled
        """
        run, times = self.run, self.run.grid[self._rows]
        z = np.stack([at_truth(run, block, x) for x in self._x])
        if isinstance(block.observer, GainOfErrors):
            for name in self._gains:
                own, start = block.states[name], design.defaults[name]
                assert isinstance(start, np.ndarray)  # none of them is a matrix
                z[:, own.start : own.start + own.size] = start.ravel()
        elif self._gains:
            z = np.stack([at_rest(run, block, self._gains, t, p, one) for t, one in zip(times, z, strict=True)])
        found = evaluate(self._slopes, times[:, None], np.tile(p, (len(z), 1)), z, np.tile(self._e, (len(z), 1)))
        shapes = [self._slopes.size_out(i) for i in range(len(found))]
        A0, E, H, _, K0, K = (values.reshape(-1, *shape) for values, shape in zip(found, shapes, strict=True))
        kept = np.ones(A0.shape[1], dtype=bool)
        for name in self._gains:
            first = block.states[name].start - block.start
            kept[first : first + block.states[name].size] = False
        A0, E, H, K0 = A0[:, kept][:, :, kept], E[:, kept], H[:, :, kept], K0[:, :, kept]
        return np.block([[A0, E], [-K0, -K]]), H

    def _radii(self, timing: AnyTiming) -> Floats:
        G, H = self._systems
        if isinstance(timing, Apart):
            return timing.factors(G, H)
        period, delay = timing.period, timing.delay
        if period is None or delay > _FINE * period:
            late = delay + (period or 0.0) / 2  # in the mean, as are samples late/n apart, late - late/(2 n) on arrival
            period, delay = late / _FINE, late - late / (2 * _FINE)
        waiting, rest = on_their_way(period, delay)
        with np.errstate(over="ignore", invalid="ignore"):
            after = exponentials(G * rest) if rest > 0 else None
            M = monodromy(exponentials(G * (period - rest)), after, H, waiting)
        known = np.all(np.isfinite(M), axis=(1, 2))
        radii = np.full(len(M), np.inf)
        radii[known] = np.max(np.abs(np.linalg.eigvals(M[known])), axis=1)
        return radii
