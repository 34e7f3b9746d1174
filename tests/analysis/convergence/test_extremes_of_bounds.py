"""Norms and eigenvalues of many matrices, of which few are decomposed: those of NumPy, which decomposes all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun.analysis.convergence import extremes


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(1, 4), columns=st.integers(1, 4))
def test_the_largest_norm(seed: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    stack = rng.standard_normal((50, rows, columns)) * rng.choice([0.0, 1.0, 3.0], (50, rows, columns))
    assert extremes.largest_norm(stack) == pytest.approx(np.linalg.norm(stack, 2, axis=(1, 2)).max(), rel=1e-14)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6), kind=st.sampled_from(["random", "settling", "constant"]))
def test_the_outermost_eigenvalues(seed: int, n: int, kind: str) -> None:
    """Also where the extreme ones are of one matrix of thousands, and where the matrices are hardly different."""
    rng = np.random.default_rng(seed)
    A = (
        rng.standard_normal((3000, n, n))
        if kind == "random"
        else np.repeat(rng.standard_normal((1, n, n)), 3000, axis=0)
    )
    stack = A + np.swapaxes(A, 1, 2)
    if kind == "settling":
        stack = stack + np.exp(-np.arange(3000) / 3)[:, None, None] * np.diag(rng.uniform(-9, 9, n))
    values = np.linalg.eigvalsh(stack)
    size = np.abs(values).max()
    assert extremes.outermost(stack) == pytest.approx((values.min(), values.max()), abs=1e-13 * size, rel=0)


def test_few_matrices_are_decomposed(monkeypatch: pytest.MonkeyPatch) -> None:
    decomposed = []
    eigvalsh = np.linalg.eigvalsh

    def counted(stack: np.ndarray) -> np.ndarray:
        decomposed.append(len(stack))
        return np.asarray(eigvalsh(stack))

    monkeypatch.setattr(np.linalg, "eigvalsh", counted)
    place = np.arange(10_000)
    stack = np.diag([1.0, 2.0]) + 0.1 * np.sin(0.01 * place)[:, None, None] * np.eye(2)
    assert extremes.outermost(stack) == pytest.approx((0.9, 2.1), rel=1e-6)
    assert sum(decomposed) < 2000
