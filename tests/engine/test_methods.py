"""The tableaux fulfil the order conditions: every rooted tree up to the order, and not one order more."""

from __future__ import annotations

from math import prod
from types import SimpleNamespace
from typing import cast

import numpy as np
import numpy.typing as npt
import pytest

from hgorun.engine.methods import DOPRI5, METHODS, RODAS5P, Method
from hgorun.engine.module import lent
from hgorun.native.ir import Function

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


@pytest.mark.parametrize("method", [m for m in METHODS.values() if isinstance(m, Method)], ids=lambda m: m.name)
def test_order_of_the_step(method: Method) -> None:
    A, b = tableau(method)
    np.testing.assert_allclose(A[:-1].sum(axis=1), method.c, atol=1e-15)
    for order in range(1, method.order + 1):
        assert defect(A, b, order) < 1e-15
    assert defect(A, b, method.order + 1) > 1e-4


def test_the_error_estimate_is_the_distance_to_a_step_of_order_four() -> None:
    method = DOPRI5
    A, b = tableau(method)
    embedded = b - np.array(method.error)
    for order in range(1, 5):
        assert defect(A, embedded, order) < 1e-15
    assert defect(A, embedded, 5) > 1e-4


def test_the_continuous_extension_has_order_four_inside_the_step() -> None:
    """b_i(s): the cubic Hermite polynomial of z0, k_1, z1, k_7, plus s^2 (1 - s)^2 d_i."""
    method = DOPRI5
    A, b = tableau(method)
    first, last = np.eye(7)[0], np.eye(7)[-1]
    for s in (0.1, 0.5, 0.8):
        hermite = s**2 * (3 - 2 * s) * b + s * (1 - s) ** 2 * first - s**2 * (1 - s) * last
        weights = hermite + s**2 * (1 - s) ** 2 * np.array(method.dense)
        for order in range(1, 5):
            scaled = max(abs(float(weights @ elementary(A, tree)) - s**order / density(tree)) for tree in trees(order))
            assert scaled < 1e-14, (s, order)


def untransformed() -> tuple[Array, Array, Array]:
    """alpha, B = alpha + Gamma and weights of a stage's u in those of k: u = Gamma k of k_i = f(z + sum alpha_ij k_j).

    Hairer and Wanner II, IV.7: k_i = h f(z + sum alpha_ij k_j) + h J sum gamma_ij k_j; 1/gamma - Gamma^-1 = coupling,
    a = alpha Gamma^-1.
    """
    method = RODAS5P
    stages = len(method.c)
    a, coupling = np.zeros((stages, stages)), np.zeros((stages, stages))
    for i, (row, coupled) in enumerate(zip(method.stages, method.coupling, strict=True), start=1):
        a[i, :i], coupling[i, :i] = row, coupled
    gamma: Array = np.asarray(np.linalg.inv(np.eye(stages) / method.gamma - coupling), dtype=np.float64)
    alpha: Array = a @ gamma
    return alpha, alpha + gamma, gamma


def implicit(alpha: Array, beta: Array, tree: Tree) -> Array:
    """What a tree gives at each stage of a Rosenbrock method: a node with one child uses beta, with more alpha."""
    along = beta if len(tree) == 1 else alpha
    found: Array = np.prod([along @ implicit(alpha, beta, child) for child in tree], axis=0) * np.ones(len(alpha))
    return found


def implicit_defect(weights: Array, order: int, s: float = 1.0) -> float:
    alpha, beta, _ = untransformed()
    return max(abs(float(weights @ implicit(alpha, beta, tree)) - s**order / density(tree)) for tree in trees(order))


def test_rodas5p_has_order_five_with_a_step_of_order_four_in_it() -> None:
    alpha, _, gamma = untransformed()
    np.testing.assert_allclose(alpha.sum(axis=1), RODAS5P.c, atol=1e-13)
    np.testing.assert_allclose(gamma.sum(axis=1), RODAS5P.drift, atol=1e-13)
    b = np.array(RODAS5P.result) @ gamma
    embedded = b - np.array(RODAS5P.error) @ gamma
    for order in range(1, 6):
        assert implicit_defect(b, order) < 1e-13
    for order in range(1, 5):
        assert implicit_defect(embedded, order) < 1e-13
    assert implicit_defect(b, 6) > 1e-5
    assert implicit_defect(embedded, 5) > 1e-5


def test_rodas5p_is_stiffly_accurate() -> None:
    """So the step is the last stage, and R(infinity) = 0: 1 - b B^-1 1."""
    _, beta, gamma = untransformed()
    b = np.array(RODAS5P.result) @ gamma
    np.testing.assert_allclose(b, beta[-1], atol=1e-13)
    assert abs(1 - b @ np.linalg.solve(beta, np.ones(len(b)))) < 1e-12


def test_rodas5p_has_order_four_inside_the_step() -> None:
    _, _, gamma = untransformed()
    b, (d1, d2, d3) = np.array(RODAS5P.result) @ gamma, np.array(RODAS5P.dense) @ gamma
    for s in (0.1, 0.5, 0.8):
        weights = s * b + s * (1 - s) * (d1 + s * (d2 + s * d3))
        for order in range(1, 5):
            assert implicit_defect(weights, order, s) < 1e-12, (s, order)


def test_what_registers_cannot_hold_is_lent_as_it_is() -> None:
    """There is nothing to emit into: a copy would be an error."""
    assert lent(cast(Function, SimpleNamespace(lanes=8)), "%states", 1000) == "%states"
