"""The tableaux fulfil the order conditions: every rooted tree up to the order, and not one order more."""

from __future__ import annotations

from math import prod

import numpy as np
import numpy.typing as npt
import pytest

from hgorun.engine.methods import METHODS, Method

Array = npt.NDArray[np.float64]
Tree = tuple["Tree", ...]  # a root and the trees that hang on it


def trees(order: int) -> list[Tree]:
    """All rooted trees with so many nodes; children in one order, so that each comes once."""
    if order == 1:
        return [()]
    return sorted({tuple(sorted(forest)) for forest in forests(order - 1)})


def forests(nodes: int) -> list[Tree]:
    if nodes == 0:
        return [()]
    return [(tree, *rest) for size in range(1, nodes + 1) for tree in trees(size) for rest in forests(nodes - size)]


def size(tree: Tree) -> int:
    return 1 + sum(size(child) for child in tree)


def density(tree: Tree) -> int:
    return size(tree) * prod(density(child) for child in tree)


def tableau(method: Method) -> tuple[Array, Array]:
    """A, with the step's own weights as one more stage where there are slopes at its end; b."""
    stages = len(method.stages) + 1
    A = np.zeros((stages + 1, stages + 1))
    for i, row in enumerate((*method.stages, method.result), start=1):
        A[i, : len(row.weights)] = np.array(row.weights) * row.scale
    return A, A[-1]


def elementary(A: Array, tree: Tree) -> Array:
    """What a tree gives at each stage: the product over its children of A times theirs."""
    found: Array = np.prod([A @ elementary(A, child) for child in tree], axis=0) * np.ones(len(A))
    return found


def defect(A: Array, weights: Array, order: int) -> float:
    """The largest |sum_i w_i Phi_i - 1/gamma| over the trees of an order."""
    return max(abs(float(weights @ elementary(A, tree)) - 1 / density(tree)) for tree in trees(order))


def test_there_are_as_many_trees_as_known() -> None:
    assert [len(trees(order)) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_order_of_the_step(method: Method) -> None:
    A, b = tableau(method)
    np.testing.assert_allclose(A[:-1].sum(axis=1), method.c, atol=1e-15)
    for order in range(1, method.order + 1):
        assert defect(A, b, order) < 1e-15
    assert defect(A, b, method.order + 1) > 1e-4


def test_the_error_estimate_is_the_distance_to_a_step_of_order_four() -> None:
    method = METHODS["dopri5"]
    A, b = tableau(method)
    embedded = b - np.array(method.error)
    for order in range(1, 5):
        assert defect(A, embedded, order) < 1e-15
    assert defect(A, embedded, 5) > 1e-4


def test_the_continuous_extension_has_order_four_inside_the_step() -> None:
    """b_i(s): the cubic Hermite polynomial of z0, k_1, z1, k_7, plus s^2 (1 - s)^2 d_i."""
    method = METHODS["dopri5"]
    A, b = tableau(method)
    first, last = np.eye(7)[0], np.eye(7)[-1]
    for s in (0.1, 0.5, 0.8):
        hermite = s**2 * (3 - 2 * s) * b + s * (1 - s) ** 2 * first - s**2 * (1 - s) * last
        weights = hermite + s**2 * (1 - s) ** 2 * np.array(method.dense)
        for order in range(1, 5):
            scaled = max(abs(float(weights @ elementary(A, tree)) - s**order / density(tree)) for tree in trees(order))
            assert scaled < 1e-14, (s, order)
