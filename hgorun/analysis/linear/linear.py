"""An observer linearised: how its states and its estimate answer to noise, around a point of its own motion.

The observer's own equations are differentiated, so nothing here knows one family from another. With e the
innovation, xi the observer's states without alpha, and c the term that enters alpha' = -c,

    xi' = flow(xi, e),    C xhat = guess(xi),    xhat = estimate(xi),    e = C xhat - y - v
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.analysis.linear.coordinates import transformed
from hgorun.analysis.reasons import RECALLS, NoValue
from hgorun.observers.capabilities import NotLinear
from hgorun.result.records.observer import ObserverResult
from hgorun.simulation.design.first_inputs import started
from hgorun.simulation.error_dynamics.slopes import slopes
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock


@dataclass(frozen=True)
class Linear:
    """Small deviations d xi of an observer's states (N), around a point.

        d xi' = A0 d xi + E de,    d(C xhat) = H d xi,    dxhat = L d xi,    dc = K0 d xi + K de

    Attributes
    ----------
    A0, E, H, L, K0, K : ndarray
        Shapes (N, N), (N, q), (q, N), (n, N), (q, N), (q, q); with one more axis in front where there is one
        system for each of several times.
    """

    A0: np.ndarray
    E: np.ndarray
    H: np.ndarray
    L: np.ndarray
    K0: np.ndarray
    K: np.ndarray

    @property
    def A(self) -> np.ndarray:
        """With a continuous, undelayed output: d xi' = A d xi + B v, shape (N, N)."""
        return np.asarray(self.A0 + self.E @ self.H)

    @property
    def B(self) -> np.ndarray:
        """How measurement noise v enters then, shape (N, q)."""
        return -self.E


class Linearisation:
    """An observer's equations, differentiated.

    Parameters
    ----------
    run : PreparedRun
        A prepared run (:func:`hgorun.simulation.simulate.prepare`).
    label : str
        Of the observer.

    Notes
    -----
    For observers that are differential equations; those that jump at samples have no flow. NoValue for those that look
    back at their own past.
    """

    def __init__(self, run: PreparedRun, label: str) -> None:
        self.run, self.label = run, label
        self.block: ObserverBlock = next(b for b in run.observers if b.label == label)
        if self.block.recalled:
            raise NoValue(RECALLS)

    @property
    def size(self) -> int:
        """N: the number of states, alpha not counted."""
        return self.block.stop - self.block.start

    @cached_property
    def _functions(self) -> ca.Function:
        run, b = self.run, self.block
        if isinstance(b.observer, NotLinear) and b.observer.not_linear is not None:
            raise NoValue(b.observer.not_linear)
        return slopes(run, b)

    def at(self, t: float, xi: np.ndarray, e: np.ndarray | None = None) -> Linear:
        """The linear system at time t, states xi (N,) and innovation e (q,), which is 0 where it is omitted."""
        z = np.zeros(self.run.structure.system.states)
        z[self.block.start : self.block.stop] = xi
        innovation = np.zeros(len(self.run.plant.model.outputs)) if e is None else e
        values = self._functions(t, self.run.numbers.p, z, innovation)
        return Linear(*[np.asarray(v.full()) for v in values])

    def trajectory(self, result: ObserverResult, points: np.ndarray, times: np.ndarray) -> Linear:
        """The linear systems at several points of the output grid of a finished run, innovation 0.

        Parameters
        ----------
        points : ndarray of int, shape (M,)
            Which points of the grid.
        times : ndarray, shape (M,)
            Their times.

        Returns
        -------
        Linear
            With one more axis in front, of length M.
        """
        return self.systems(times, self.states(result, points))

    def systems(self, times: np.ndarray, xi: np.ndarray, e: np.ndarray | None = None) -> Linear:
        """The linear systems at times (M,), states (M, N) and innovations (M, q), 0 where they are omitted.

        Returns
        -------
        Linear
            With one more axis in front, of length M.
        """
        count, f = times.size, self._functions.map(times.size)
        z = np.zeros((count, self.run.structure.system.states))
        z[:, self.block.start : self.block.stop] = xi
        innovation = np.zeros((count, len(self.run.plant.model.outputs))) if e is None else e
        p = np.tile(self.run.numbers.p, (count, 1))
        # CasADi's matrices become arrays through lists, which takes ten times as long as the evaluation
        buffer, call = f.buffer()
        arguments = [np.ascontiguousarray(v, dtype=float) for v in (times, p, z, innovation)]
        for i, values in enumerate(arguments):
            buffer.set_arg(i, values.data)
        shapes = [value.shape for value in self._functions.sx_out()]
        results = [np.zeros((count, columns, rows)) for rows, columns in shapes]
        for i, values in enumerate(results):
            buffer.set_res(i, values.data)
        call()
        return Linear(*[np.ascontiguousarray(values.swapaxes(1, 2)) for values in results])

    def at_truth(self, x: np.ndarray, result: ObserverResult | None = None, i: int = 0) -> np.ndarray:
        """The states xi (N,) of an observer that has found the plant's state x, filters empty.

        Gains that are states, such as P, are those at point i of the output grid of a finished run, or as they start
        where none is given.
        """
        b, form = self.block, self.block.form
        canonical = b.canonical
        z0 = self.run.numbers.z0[b.start : b.stop].copy()
        place = b.states["xhat"]
        estimate = started(form, x, self.run.plant, canonical, self.run.recorded)
        z0[place.start - b.start :][: place.size] = b.observer.start(estimate, b.design)
        for name, role in b.observer.roles(form).items():
            if result is not None and role == "gain" and b.states[name].size:
                own = b.states[name]
                z0[own.start - b.start :][: own.size] = own.flattened(result.internal[name][[i]])[0]
        return z0

    def along(self, result: ObserverResult, i: int) -> np.ndarray:
        """The states xi (N,) at point i of the output grid of a finished run."""
        return np.asarray(self.states(result, np.array([i]))[0])

    def states(self, result: ObserverResult, points: np.ndarray) -> np.ndarray:
        """The states xi (M, N) at several points of the output grid of a finished run."""
        parts = []
        self._require_unclipped(result, points)
        for name, place in self.block.states.items():
            if name == "xhat":
                parameters, canonical = self.run.plant.parameters, self.block.canonical
                estimates = transformed(self.block.form, result.xhat[points], parameters, canonical=canonical)
                parts.append(self.block.observer.start(estimates, self.block.design))
            elif name != "alpha" and place.size:
                parts.append(place.flattened(result.internal[name][points]))
        return np.concatenate(parts, axis=1)

    def _require_unclipped(self, result: ObserverResult, points: np.ndarray) -> None:
        """Where what is shown of an estimate lies at a bound, what is behind it is not known."""
        b, names = self.block, self.block.form.plant.states
        if not b.observer.clip_estimate:
            return
        shown = result.xhat[points]
        for name, bounds in b.observer.saturation.items():
            if name in names and np.any(np.isin(shown[:, names.index(name)], bounds)):
                raise NoValue(f"{name} is clipped to its bounds along the run (clip_estimate)")
