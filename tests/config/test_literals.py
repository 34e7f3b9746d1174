"""Expressions without their numbers: what is a number of a run, and what decides the structure."""

from __future__ import annotations

import casadi as ca
import pytest

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.literals import template


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("0.5*sin(3*t)", (0.5, 3.0)),
        ("2*pi*t", (2 * 3.141592653589793,)),
        ("1/3 + t", (1 / 3,)),
        ("t", ()),
        ("2", (2.0,)),
        ("t**2*3", (3.0,)),
        ("2**t", ()),
        ("(0.7*t)**2.5", (0.7,)),
        ("where(t < 5, 1, 0)", (5.0, 1.0, 0.0)),
        ("where(1, t, 1/0)", ()),
        ("t > 1 and t < 2", ()),
        ("max(0, t, 1)", (0.0, 1.0)),
        ("-3*t", (-3.0,)),
    ],
)
def test_what_is_taken_out(text: str, numbers: tuple[float, ...]) -> None:
    expression = parse(text, names=("t",))
    lifted, found = template(expression)
    assert found == numbers
    t, n = ca.SX.sym("t"), ca.SX.sym("n", len(found))
    value = ca.Function("v", [t, n], [lifted.symbol({"t": t}, n)])
    for x in (0.3, 1.7, 6.1):
        assert float(value(x, list(found))) == pytest.approx(expression.number({"t": x}), rel=1e-15)


def test_templates_are_equal_where_numbers_alone_differ() -> None:
    def of(text: str) -> object:
        return template(parse(text, names=("t",)))[0]

    assert of("0.5*sin(3*t)") == of("0.7*sin(1*t)")
    assert hash(of("0.5*sin(3*t)")) == hash(of("0.7*sin(1*t)"))
    assert of("t**2") != of("t**3")
    assert of("sin(t)") != of("cos(t)")


def test_a_part_without_value_is_refused() -> None:
    with pytest.raises(ExpressionError, match="divides by zero"):
        template(parse("t*(1/0)", names=("t",)))
