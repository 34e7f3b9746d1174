"""Nested saturations between the corrections along a chain, so that the estimate does not peak."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Block, Name, Positive
from hgorun.errors import Problem
from hgorun.observers.capabilities import LocallyLinear
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

_PROVED = 3  # order up to which no start was found from which it does not converge
NESTED_FROM = {"nested": "in the spirit of Farza et al. 2021, in a form of our own"}
Bounds = tuple[Positive, ...]


class NestedBlock(Block):
    """The key ``nested``."""

    M: Bounds | dict[Name, Bounds] = Field(
        description="bounds of x_2..x_n, n - 1 numbers > 0 in the units of the chain, best twice the largest |x_i|; "
        "with several outputs {output: [...]}"
    )


class NestedSaturation(LocallyLinear):
    """The key ``nested`` of an observer whose correction is theta^i g_i w_i along each chain."""

    nested: NestedBlock | None = Field(
        default=None,
        description="{M: [...]}: each correction passes through a saturation into the next one of the chain, "
        "which bounds peaking",
    )

    @property
    def nonlinear(self) -> str | None:
        return None if self.nested is None else "a nested saturation is active while |v_i| > M_i"

    def nested_limits(self, form: CanonicalForm, theta: float, G: np.ndarray) -> dict[str, np.ndarray]:
        """M_i/(theta^i g_i) of every chain, stacked: where w_i, and so v_i, is clipped; nothing without the key.

        Raises
        ------
        Problem
            When there are not n - 1 bounds for a chain of n, or a gain is not positive.
        """
        if self.nested is None:
            return {}
        limits, first = [], 0
        for output, length in zip(form.plant.outputs, form.chains, strict=True):
            M, own = self._bounds(output, form), G[first : first + length]
            if len(M) != length - 1:
                raise Problem(
                    ("nested", "M"),
                    f"expected {length - 1} numbers for the chain of {output}, which bound its states from the second "
                    f"on; found {len(M)}",
                )
            if np.any(own[:-1] <= 0):
                raise Problem(("gains",), "nested saturations need gains > 0 of every state but the last of a chain")
            limits.append(np.asarray(M) / (theta ** np.arange(1, length) * own[:-1]))
            first += length
        return {"limits": np.concatenate(limits)}

    def _bounds(self, output: str, form: CanonicalForm) -> Bounds:
        assert self.nested is not None
        M = self.nested.M
        if not isinstance(M, dict):
            return M
        if set(M) != set(form.plant.outputs):
            raise Problem(("nested", "M"), f"expected bounds for each output: {', '.join(form.plant.outputs)}")
        return M[output]

    def driving(self, s: Symbols, e: ca.SX) -> ca.SX:
        """w_1 of every chain: the innovation, or what a filter makes of it, shape (q,)."""
        return e

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        w = nested(plant, self.driving(s, e), k)
        last = np.cumsum(plant.chains) - 1
        return ca.fabs(w[[i for i in range(w.numel()) if i not in last]]) >= k.limits

    def remarks(self, form: CanonicalForm) -> tuple[str, ...]:
        """Where convergence from far away is not to be counted on."""
        if self.nested is None or max(form.chains) <= _PROVED:
            return ()
        return (
            f"with nested saturations and n = {max(form.chains)} an estimate may not come back from initial errors "
            "larger than M: choose M so that it covers them",
        )


def nested(plant: PlantCopy, e: ca.SX, k: Symbols) -> ca.SX:
    """w of every chain, stacked: w_1 = e, w_i = sat(w_(i-1)); e repeated where there are no limits.

    v_i = theta^i g_i w_i is then theta (g_i/g_(i-1)) sat_(M_(i-1))(v_(i-1)), and with no saturation active the linear
    correction to the last bit.
    """
    return _stacked(plant.chains, e, k.limits) if "limits" in vars(k) else plant.along_chains(e)


def _stacked(chains: tuple[int, ...], e: ca.SX, limits: ca.SX) -> ca.SX:
    w, place = [], 0
    for i, length in enumerate(chains):
        w.append(e[i])
        for _ in range(length - 1):
            w.append(clipped(w[-1], limits[place]))
            place += 1
    return ca.vertcat(*w)


def clipped(value: ca.SX, limit: ca.SX) -> ca.SX:
    """sat(value): between -limit and limit, entry by entry."""
    return ca.fmax(-limit, ca.fmin(limit, value))
