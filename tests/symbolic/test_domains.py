"""What is said of expressions that are not numbers."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic.domains import first_undefined


def said(expression: Callable[[ca.SX, ca.SX], ca.SX], x: float, y: float) -> str | None:
    z = ca.SX.sym("z", 2)
    names = [(z[0], "x"), (z[1], "y")]
    return first_undefined(expression(z[0], z[1]), [z], [np.array([x, y])], names)


@pytest.mark.parametrize(
    ("expression", "x", "y", "words"),
    [
        (lambda x, y: ca.sqrt(x) + y, -0.25, 1, "sqrt of a negative number (x = -0.25)"),
        (lambda x, y: ca.sqrt(x - y), 1, 3, "sqrt of a negative number (-2)"),
        (lambda x, y: ca.log(y), 1, 0, "log of a number that is not positive (y = 0)"),
        (lambda x, y: ca.asin(x), 1.5, 0, "asin or acos of a number beyond 1 (x = 1.5)"),
        (lambda x, y: ca.acos(x), -2, 0, "asin or acos of a number beyond 1 (x = -2)"),
        (lambda x, y: x / (x - y), 2, 2, "division by zero"),
        (lambda x, y: 1 / y, 2, 0, "division by zero (y = 0)"),
        (lambda x, y: x**y, -2, 0.5, "power of a negative number (x = -2)"),
        (lambda x, y: x**y, 0, -1, "division by zero (x = 0)"),
        (lambda x, y: ca.sqrt(ca.log(x)), -1, 0, "log of a number that is not positive (x = -1)"),
    ],
)
def test_the_first_operation_outside_its_domain_is_named(
    expression: Callable[[ca.SX, ca.SX], ca.SX], x: float, y: float, words: str
) -> None:
    assert said(expression, x, y) == words


@pytest.mark.parametrize(
    ("expression", "x", "y"),
    [
        (lambda x, y: x + y, 1, 2),  # nothing in it has a domain
        (lambda x, y: ca.sqrt(x) / y, 4, 2),
        (lambda x, y: x**y, -2, 3),
        (lambda x, y: ca.sqrt(x), -1e200, 0),  # the argument has exploded itself
    ],
)
def test_nothing_is_said_where_all_is_defined(expression: Callable[[ca.SX, ca.SX], ca.SX], x: float, y: float) -> None:
    assert said(expression, x, y) is None


def test_a_state_is_not_blamed_for_an_argument_that_depends_on_numbers_without_a_name() -> None:
    z = ca.SX.sym("z", 2)  # an estimate and its variance: a point beside it is outside, not the estimate
    what = first_undefined(ca.sqrt(z[0] - ca.sqrt(z[1])), [z], [np.array([0.2, 4.0])], [(z[0], "x")])
    assert what == "sqrt of a negative number (-1.8)"
