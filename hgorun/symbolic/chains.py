"""Chains of states as they are written: x_i' = c_i x_(i+1) + phi_i(t, u, x_1..x_i) with constant c_i, y = c_0 x_1.

The states may be listed in any order, and the links c may be expressions of parameters: neither the order nor
the units in which a plant is written decide whether it is a chain. With several outputs the chains may feed each
other downwards, phi_i depending on the first i states of all; outputs that measure one state share its chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from hgorun.memo import Memo
from hgorun.symbolic.evaluate import at
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True, eq=False, repr=False)
class Chain:
    """The chain of an output: z_i = scale_i x_(state i), so that z_1 is the output and all links are 1.

    Attributes
    ----------
    states : tuple of int
        Places in the plant's state, the measured one first.
    scales : tuple of casadi.SX
        c_0, c_0 c_1, c_0 c_1 c_2, ...: expressions of the parameters.
    """

    states: tuple[int, ...]
    scales: tuple[ca.SX, ...]


class Links:
    """Which derivative depends on which state, and where it does so by a constant slope.

    Parameters
    ----------
    plant : PlantModel
    """

    def __init__(self, plant: PlantModel) -> None:
        self.plant = plant
        rows = ca.vertcat(plant.output, plant.dynamics)
        self._slopes = ca.jacobian(rows, plant.x)
        count = rows.numel(), plant.n
        self._depends, self._constant = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        moving = ca.vertcat(plant.t, plant.x, plant.u)
        sparsity = self._slopes.sparsity()
        for i, j in zip(sparsity.row(), sparsity.get_col(), strict=True):
            self._slopes[i, j] = ca.simplify(self._slopes[i, j])
            self._depends[i, j] = True
            self._constant[i, j] = not ca.depends_on(self._slopes[i, j], moving)
        constants = ca.SX(ca.DM(self._constant.astype(float))) * self._slopes
        self._values = ca.Function("c", [plant.p], [ca.densify(constants)])
        self._same_for_all = not ca.depends_on(constants, plant.p)
        self._known: Memo[tuple[Chain, ...] | None] = Memo(8)

    def chains(self, parameters: np.ndarray) -> tuple[Chain, ...] | None:
        """The chain of every output; None where the plant is not made of chains with these parameters."""
        key = b"" if self._same_for_all else parameters.tobytes()
        return self._known.get(key, lambda: self._chains(parameters))

    def _chains(self, parameters: np.ndarray) -> tuple[Chain, ...] | None:
        q, n = len(self.plant.outputs), self.plant.n
        values = at(self._values, parameters)[0].reshape(q + n, n)
        if not np.all(np.isfinite(values)):
            return None
        linked = self._depends & ~(self._constant & (values == 0))
        measured = [np.flatnonzero(row) for row in linked[:q]]
        if any(row.size != 1 or not self._constant[i, row[0]] for i, row in enumerate(measured)):
            return None
        heads = [int(row[0]) for row in measured]
        orders = self._orders(list(dict.fromkeys(heads)), linked[q:])
        if orders is None:
            return None
        return tuple(self._chain(i, orders[head]) for i, head in enumerate(heads))

    def _orders(self, heads: Sequence[int], linked: np.ndarray) -> dict[int, list[int]] | None:
        """The states of the chain that begins at each measured state."""
        orders = {head: [head] for head in heads}
        known, ends = set(heads), dict.fromkeys(heads)
        while ends:
            # a chain goes on with the one state that comes in with its last derivative
            coming = {head: np.flatnonzero(linked[orders[head][-1]]) for head in ends}
            new = {head: [int(j) for j in states if j not in known] for head, states in coming.items()}
            following = [j for states in new.values() for j in states]
            if any(len(states) > 1 for states in new.values()) or len(set(following)) < len(following):
                return None
            for head, states in new.items():
                if states and not self._constant[len(self.plant.outputs) + orders[head][-1], states[0]]:
                    return None
                orders[head] += states
            known.update(following)
            ends = dict.fromkeys(head for head, states in new.items() if states)
        return orders if len(known) == linked.shape[0] else None

    def _chain(self, output: int, order: Sequence[int]) -> Chain:
        scales = [self._slopes[output, order[0]]]
        for state, following in pairwise(order):
            scales.append(scales[-1] * self._slopes[len(self.plant.outputs) + state, following])
        return Chain(tuple(order), tuple(scales))
