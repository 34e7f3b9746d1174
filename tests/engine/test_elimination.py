"""Symbolic elimination against numpy, on random sparse matrices."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from hgorun.engine.elimination import factor


@pytest.mark.parametrize("seed", range(20))
def test_the_solution_is_numpys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 14))
    matrix = np.where(rng.random((n, n)) < rng.uniform(0.05, 0.6), rng.normal(size=(n, n)), 0) + 4 * np.eye(n)
    right = rng.normal(size=n)
    found = factor(ca.SX(ca.sparsify(ca.DM(matrix)))).solve(ca.SX(right))
    np.testing.assert_allclose(np.array(ca.DM(found)).ravel(), np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-12)


def test_other_entries_in_the_same_structure() -> None:
    matrix, right = ca.SX([[4, 1, 0], [1, 5, 0], [2, 0, 3]]), ca.SX([1, 2, 3])
    factors = factor(ca.sparsify(matrix))
    other = factor(ca.sparsify(2 * matrix))
    moved = factors.with_entries(other.entries())
    np.testing.assert_allclose(np.array(ca.DM(moved.solve(right))), np.array(ca.DM(other.solve(right))), rtol=1e-15)


def test_an_arrow_is_solved_without_fill() -> None:
    """Its tip, which everything hangs on, comes last; in the order as written all places would fill."""
    n = 30
    pattern = np.eye(n)
    pattern[0, :] = pattern[:, 0] = 1
    assert len(list(factor(ca.SX(ca.sparsify(ca.DM(pattern + 40 * np.eye(n))))).entries())) == 3 * n - 2


def test_what_is_not_a_number_stays_in_its_block() -> None:
    """A chain of blocks 0 -> 1, 0 -> 2: with NaN in block 1 the others are solved as if it were not there."""
    matrix = np.eye(6) * 3 + np.kron(np.eye(3), [[0, 1], [-1, 0]])
    matrix[2:, 0] = 1
    spoilt = matrix.copy()
    spoilt[2:4, 2:4] = np.nan
    right = np.arange(1.0, 7.0)
    structure = ca.sparsify(ca.DM(matrix)).sparsity()
    rows, columns = structure.get_triplet()
    entries = ca.SX.sym("m", structure)
    solve = ca.Function("solve", [entries], [factor(entries).solve(ca.SX(right))])
    found = np.array(solve(ca.DM(structure, spoilt[rows, columns]))).ravel()
    expected = np.linalg.solve(matrix, right)
    healthy = [0, 1, 4, 5]
    np.testing.assert_allclose(found[healthy], expected[healthy], rtol=1e-12)
    assert np.all(np.isnan(found[2:4]))
