"""How matrices lie in the state vector: there and back, symbolically and in numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic.matrices import A, B, C, hurwitz_gain, inv_Delta
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.states import StateBlock, Symmetric

SHAPES = [(3,), (2, 3), (3, 2), (4, 1), (1, 3), (1,)]


def random_value(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape)


def symmetric(n: int) -> np.ndarray:
    M = random_value((n, n))
    return M + M.T


BLOCKS = [(StateBlock.of(2, random_value(shape)), random_value(shape)) for shape in SHAPES]
BLOCKS += [(StateBlock.of(2, Symmetric(symmetric(n))), symmetric(n)) for n in (1, 2, 4)]


@pytest.mark.parametrize(("block", "value"), BLOCKS, ids=lambda b: str(getattr(b, "shape", "")))
def test_there_and_back(block: StateBlock, value: np.ndarray) -> None:
    rows = np.zeros((2, block.start + block.size + 3))
    rows[1, block.start : block.start + block.size] = block.numbers(value)
    shaped = block.shaped(rows)
    np.testing.assert_array_equal(shaped[1], value.reshape(shaped.shape[1:]))
    np.testing.assert_array_equal(shaped[0], 0)
    np.testing.assert_array_equal(block.flattened(shaped)[1], block.numbers(value))
    z = ca.SX.sym("z", rows.shape[1])
    symbol = ca.Function("f", [z], [block.symbol(z), block.flat(block.symbol(z))])
    matrix, flat = (np.asarray(part.full()) for part in symbol(rows[1]))
    np.testing.assert_array_equal(matrix, value.reshape(matrix.shape))
    np.testing.assert_array_equal(flat.ravel(), block.numbers(value))


def test_a_number_stands_for_ones_or_for_the_identity() -> None:
    np.testing.assert_array_equal(StateBlock(0, (3,)).initial(2, np.zeros(3)), [2, 2, 2])
    np.testing.assert_array_equal(StateBlock(0, (2, 2), symmetric=True).initial(3, np.zeros((2, 2))), 3 * np.eye(2))
    np.testing.assert_array_equal(StateBlock(0, (2, 2)).initial([1, 2, 3, 4], np.zeros((2, 2))), [[1, 2], [3, 4]])


@pytest.mark.parametrize("given", [[1, 2], "text", [1, np.nan, 3], np.inf, None, [[1], [2, 3]]])
def test_what_does_not_fit_is_refused(given: object) -> None:
    with pytest.raises(ValueError, match="expected a number or 3 numbers"):
        StateBlock(0, (3,)).initial(given, np.zeros(3))


def test_numbers_for_each_row_of_a_symmetric_matrix_are_its_diagonal() -> None:
    block = StateBlock(0, (3, 3), symmetric=True)
    np.testing.assert_array_equal(block.initial([1, 2, 3], np.eye(3)), [[1, 0, 0], [0, 2, 0], [0, 0, 3]])
    right = r"expected a number or 3 numbers for the diagonal such as \[0.1, 0.1, 0.1\] or 3 rows of 3, in the order of"
    for wrong in ([1, 2], {"a": 1}, [1, np.nan, 3]):
        with pytest.raises(ValueError, match=right):
            block.initial(wrong, np.eye(3))
    with pytest.raises(ValueError, match="for the diagonal or 7 rows of 7"):
        StateBlock(0, (7, 7), symmetric=True).initial([1], np.eye(7))


def test_a_matrix_that_must_be_symmetric() -> None:
    with pytest.raises(ValueError, match="symmetric"):
        StateBlock(0, (2, 2), symmetric=True).initial([[1, 2], [3, 1]], np.eye(2))


def test_parameters_lie_one_after_the_other() -> None:
    p = Parameters()
    assert p.values.size == p.symbol.numel() == 0
    matrix = random_value((2, 3))
    a, M, v = p.add("a", 2.5), p.add("M", matrix), p.add("v", [1.0, 2.0])
    f = ca.Function("f", [p.symbol], [a, M, v])
    for found, expected in zip(f(p.values), (2.5, matrix, [[1], [2]]), strict=True):
        np.testing.assert_array_equal(np.asarray(found.full()), np.asarray(expected).reshape(found.shape))


@pytest.mark.parametrize("k", [1, 2, 5])
def test_the_matrices_of_a_chain(k: int) -> None:
    z = np.arange(1.0, k + 1)
    np.testing.assert_array_equal(np.asarray(A(k) @ z).ravel(), [*z[1:], 0])
    np.testing.assert_array_equal(np.asarray(C(k) @ z).ravel(), z[:1])
    np.testing.assert_array_equal(np.asarray(B(k)).ravel(), [0] * (k - 1) + [1])
    np.testing.assert_array_equal(np.diag(np.asarray(ca.DM(ca.evalf(inv_Delta(ca.SX(3), k))))), 3.0 ** np.arange(k))


@pytest.mark.parametrize("poles", [-2.0, [-1, -2, -5], [-1, -2 + 1j, -2 - 1j]])
def test_the_gain_places_the_poles(poles: complex) -> None:
    M = np.asarray(A(3)) - np.outer(hurwitz_gain(3, poles), np.asarray(C(3)))
    expected = np.poly(np.full(3, poles) if np.ndim(poles) == 0 else np.asarray(poles))
    np.testing.assert_allclose(np.poly(M), expected.real, rtol=1e-12)
    assert hurwitz_gain(0, -1).shape == (0,)
