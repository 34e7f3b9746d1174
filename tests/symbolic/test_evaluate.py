"""Functions along arrays: the numbers that CasADi's own calls give, bit for bit."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from hgorun.native.elementary import apply
from hgorun.symbolic.evaluate import along, at, compiled, evaluate
from hgorun.symbolic.interpreter import arithmetic, interpreted

T, P, Z = ca.SX.sym("t"), ca.SX.sym("p", 2), ca.SX.sym("z", 5)
X = ca.SX.sym("x", 2)
F = ca.Function("f", [T, P, Z], [ca.sqrt(P[0] ** 2 + T) * Z[:2], ca.horzcat(Z[2:4], P), ca.diag(Z[:3]), ca.SX(2, 1)])


@pytest.mark.parametrize("points", [1, 2, 127, 128, 129, 300, 600])
def test_every_number_of_points(points: int) -> None:
    random = np.random.default_rng(points)
    t, p, z = random.uniform(size=(points, 1)), random.normal(size=2), random.normal(size=(points, 5))
    vector, matrix, sparse, zero = evaluate(F, t, p, z)
    for i in range(points):
        expected = [np.asarray(v.full()) for v in F(t[i, 0], p, z[i])]
        assert np.array_equal(vector[i], expected[0][:, 0])
        assert np.array_equal(matrix[i], expected[1])
        assert np.array_equal(sparse[i], expected[2])
        assert np.array_equal(zero[i], [0, 0])


def test_a_function_without_elementary_functions_is_left_to_casadi() -> None:
    assert not interpreted(F)
    assert interpreted(compiled("sin(x) + y", "x", "y"))


def test_many_instructions_are_carried_out_in_pieces() -> None:
    x = np.random.default_rng(0).uniform(size=10_000)
    found = along(compiled("exp(x) + 1", "x"), x)
    assert np.array_equal(found, apply("exp", x) + 1)


ODD = np.array([0.0, -0.0, 1.5, -2.0, np.inf, -np.inf, np.nan, 5e-324])


def test_arithmetic_at_many_points_is_that_of_casadi() -> None:
    """Also of numbers that are none, and of conditions; what CasADi's library decides is left to it."""
    x, y = X[0], X[1]
    chosen = ca.if_else(ca.logic_or(x <= y, x != x), x / y, ca.floor(x) - ca.sign(y))
    function = ca.Function(
        "f", [X], [ca.vertcat(chosen, 1 / x, ca.sqrt(x), 2 * x * x, ca.if_else(y, x, -y), ca.fabs(y))]
    )
    assert arithmetic(function)
    rows = np.array(np.meshgrid(ODD, ODD)).reshape(2, -1).T.repeat(9, axis=0)
    assert len(rows) > 512
    (found,) = evaluate(function, rows)
    expected = np.array([np.asarray(function(row).full())[:, 0] for row in rows[::9]]).repeat(9, axis=0)
    np.testing.assert_array_equal(found, expected)
    assert np.array_equal(np.signbit(found[found == 0]), np.signbit(expected[expected == 0]))
    assert not arithmetic(ca.Function("f", [X], [ca.fmin(x, y)]))
    assert not arithmetic(ca.Function("f", [X], [ca.sin(x)]))


def test_no_points_and_one_point() -> None:
    nothing = evaluate(F, np.zeros((0, 1)), [1, 2], np.zeros((0, 5)))
    assert [v.shape for v in nothing] == [(0, 2), (0, 2, 2), (0, 3, 3), (0, 2)]
    assert [v.shape for v in at(F, 0.5, [1, 2], np.ones(5))] == [(2,), (2, 2), (3, 3), (2,)]


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="argument 2"):
        evaluate(F, np.zeros((4, 1)), [1, 2], np.zeros((4, 3)))


def test_along_times() -> None:
    times = np.linspace(0, 1, 7)
    assert np.array_equal(along(compiled("t**2 + k", "t", "k"), times, 2.0), times**2 + 2)
    assert compiled("t**2", "t") is compiled("t**2", "t")


SPARSE = ca.SX(2, 3)
SPARSE[0, 2], SPARSE[1, 0] = X[0], X[0] * X[1]


@pytest.mark.parametrize(
    "expression",
    [X * 2, X.T, SPARSE, ca.SX(2, 2), ca.jacobian(ca.SX(1), X)],
    ids=["column", "row", "sparse", "empty", "slope"],
)
@pytest.mark.parametrize("points", [1, 3, 200])
def test_every_sparsity(expression: ca.SX, points: int) -> None:
    function = ca.Function("f", [X], [expression])
    rows = np.random.default_rng(0).uniform(-1, 1, (points, 2))
    (found,) = evaluate(function, rows)
    for row, values in zip(rows, found, strict=True):
        expected = np.asarray(function(row).full())
        np.testing.assert_array_equal(values, expected[:, 0] if expected.shape[1] == 1 else expected)
