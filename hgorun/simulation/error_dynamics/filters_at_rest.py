"""Whether an observer's filters come to rest at zero while the estimate is right, as theory takes them to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np

from hgorun.symbolic.states import StateBlock, Symmetric

_ROUNDING = 1e-12  # of the terms that a rate is made of
_STILL = 1e-6  # of the same, where a root was sought
_ZERO = 1e-6  # of where the filters start or rest


def rates_and_sizes(
    derivatives: Mapping[str, ca.SX], filters: Mapping[str, StateBlock], z: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """How fast the filters move, and the size of what they move by, to tell rounding from motion; shapes (m,)."""
    rate = ca.vertcat(*[block.flat(derivatives[name]) for name, block in filters.items()])
    reach = ca.fabs(z)
    for block in filters.values():  # of terms that cancel there is no slope, so that these stand for them
        reach[block.start : block.start + block.size] = ca.norm_inf(z)
    return ca.densify(rate), ca.densify(ca.fabs(ca.jacobian(rate, z)) @ reach)


def values_of(rates: ca.Function, *arguments: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of both, shapes (m,)."""
    rate, size = (np.ravel(value.full()) for value in rates(*arguments))
    return rate, size


def not_at_zero(
    filters: Mapping[str, StateBlock],
    starts: Mapping[str, np.ndarray | Symmetric],
    z: np.ndarray,
    evaluate: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> tuple[str, ...]:
    """The filters that rest elsewhere than at zero, or nowhere: their roles are not those that are declared.

    Parameters
    ----------
    filters : mapping of str to StateBlock
        Their places in z.
    starts : mapping of str to ndarray or Symmetric
        Where they start by themselves.
    z : ndarray
        All states; the estimate is right.
    evaluate : callable
        From all states to how fast the filters move without innovation, and the size of what they move by.
    """
    values = [starts[name] for name in filters]
    numbers = [value.values if isinstance(value, Symmetric) else value for value in values]
    start = np.concatenate([block.numbers(v) for block, v in zip(filters.values(), numbers, strict=True)])
    places = np.concatenate([np.arange(block.start, block.start + block.size) for block in filters.values()])
    owner = np.repeat(list(filters), [block.size for block in filters.values()])

    def rates(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = z.copy()
        at[places] = values
        return evaluate(at)

    rate, size = rates(np.zeros(places.size))
    away = (start != 0) | (np.abs(rate) > _ROUNDING * size)
    if away.any():
        rest = _rest(rates, start)
        if rest is not None:
            away = np.abs(rest) > _ZERO * np.max(np.abs([rest, start]))
    return tuple(name for name in filters if np.any(away[owner == name]))


def _rest(rates: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], start: np.ndarray) -> np.ndarray | None:
    """Where they rest that start there; None where none is found. What does not move by itself rests at its start."""
    from scipy.optimize import root  # only of observers whose roles are to be doubted

    found = np.asarray(root(lambda values: rates(values)[0], start, method="lm").x)
    rate, size = rates(found)
    return found if np.all(np.abs(rate) <= _STILL * size) else None
