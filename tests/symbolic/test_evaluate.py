"""Functions of CasADi at numbers, without a detour over its own matrices."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic.evaluate import evaluate

x = ca.SX.sym("x", 2)
SPARSE = ca.SX(2, 3)
SPARSE[0, 2], SPARSE[1, 0] = x[0], x[0] * x[1]


@pytest.mark.parametrize(
    "expression",
    [x * 2, x.T, SPARSE, ca.SX(2, 2), ca.jacobian(ca.SX(1), x)],
    ids=["column", "row", "sparse", "empty", "slope"],
)
@pytest.mark.parametrize("points", [1, 3, 200])
def test_as_casadi_does(expression: ca.SX, points: int) -> None:
    function = ca.Function("f", [x], [expression])
    at = np.random.default_rng(0).uniform(-1, 1, (points, 2))
    (found,) = evaluate(function, at)
    for row, values in zip(at, found, strict=True):
        expected = np.asarray(function(row).full())
        np.testing.assert_array_equal(values, expected[:, 0] if expected.shape[1] == 1 else expected)
