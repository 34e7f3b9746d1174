"""What is shown of a run: states and functions of states, along its output grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.result.evaluation.estimated import columns_of
from hgorun.symbolic.evaluate import Floats, evaluate


@dataclass(frozen=True, eq=False, repr=False)
class Readout:
    """What is shown of a run: some of its states, or where these are None a function of (t, p, z, w)."""

    places: list[int] | None
    function: ca.Function

    @classmethod
    def of(cls, expression: ca.SX, symbols: Sequence[ca.SX], among: Sequence[int]) -> Readout:
        """An expression of the symbols (t, p, z, w); ``among`` are the states that it may be."""
        function = ca.Function("shown", list(symbols), [ca.densify(expression)])
        return cls(_states(expression, symbols[2], among), function)

    def along(self, times: Floats, p: Floats, z: Floats, w: Floats | None = None) -> Floats:
        """The values along a run, shape (len(times), size).

        Parameters
        ----------
        times : ndarray, shape (N,)
        p : ndarray
        z : ndarray, shape (N, states)
        w : ndarray, shape (N, held numbers), optional
            Needed where inputs are recorded.
        """
        if self.places is not None:
            return columns_of(z, self.places)
        if not self.function.numel_out(0):
            return np.zeros((len(times), 0))
        held = np.zeros(self.function.size1_in(3)) if w is None else w
        return evaluate(self.function, times[:, None], p, z, held)[0]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LoopReadout:
    """What is shown of a plant that a controller drives.

    Attributes
    ----------
    x, integral, effort : list of int
        Places in z of the plant's states, of the controller's integrals and of the integrals of u^2.
    cost : int or None
        That of the cost so far.
    inputs, outputs : Readout
        u and y.
    """

    x: list[int]
    integral: list[int]
    effort: list[int]
    cost: int | None
    inputs: Readout
    outputs: Readout


def _states(expression: ca.SX, z: ca.SX, among: Sequence[int]) -> list[int] | None:
    """Which states the entries of an expression are; None where one of them is something else."""
    found = [next((k for k in among if ca.is_equal(e, z[k])), None) for e in ca.vertsplit(expression)]
    places = [k for k in found if k is not None]
    return places if places and len(places) == len(found) else None
