"""Expressions as values: from text and from numbers, equal, hashable, and without CasADi until needed."""

import math
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from hgorun.config.expressions import Expression, ExpressionError, parse


@pytest.mark.parametrize(
    ("value", "text"), [(2, "2"), (0.1, "0.1"), (-3, "-3"), (1e-3, "0.001"), (np.float64(2), "2.0")]
)
def test_numbers_are_expressions(value: float, text: str) -> None:
    expression = parse(value, names=())
    assert expression.number() == float(value)
    assert expression.text == text
    assert expression.names == frozenset()
    assert parse(expression.text).number() == float(value)


@pytest.mark.parametrize("value", [True, False, None, math.nan, math.inf, -math.inf, 10**400, 1j, [1], {}, b"1"])
def test_other_values_are_refused(value: Any) -> None:
    with pytest.raises(ExpressionError):
        parse(value)


def test_an_expression_is_a_value() -> None:
    expression = parse(" x + 1 ")
    assert expression.text == "x + 1"
    assert expression == parse("x + 1")
    assert hash(expression) == hash(parse("x + 1"))
    assert pickle.loads(pickle.dumps(expression)).number({"x": 1}) == 2
    assert isinstance(expression, Expression)
    assert "_tree" not in repr(expression)


@pytest.mark.costly
def test_casadi_is_imported_only_for_symbols() -> None:
    code = "import sys; from hgorun.config.expressions import parse; parse('sin(1)').number();"
    code += "print('casadi' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"
