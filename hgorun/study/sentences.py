"""The values of claims: expressions of quantities.

A value is an expression such as ``hf('te02/FHGO I', x3) / hf('te02/SHGO', x3)``. The quantities are taken out and
measured; what remains is an expression of numbers, read by the grammar of all configurations.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.config.expressions import Expression, ExpressionError, parse
from hgorun.result.quantities.quantities import CALL, quantity_of
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.quantities.quoted import quoted

_LARGE = 1e300  # what the error of a diverged observer counts as


@dataclass(frozen=True, eq=False, repr=False)
class Sentence:
    """A claim's value: quantities, and how they are put together.

    Attributes
    ----------
    quantities : tuple of Quantity
    expression : Expression
        Of the names q0, q1, ....
    """

    quantities: tuple[Quantity, ...]
    expression: Expression

    def value(self, measured: Mapping[str, float]) -> float:
        """The value, from the measured quantities by their texts; infinite where an observer diverged."""
        found = {f"q{i}": measured[str(q)] for i, q in enumerate(self.quantities)}
        if any(np.isnan(v) for v in found.values()):
            return float("nan")
        try:
            value = self.expression.number({n: float(np.clip(v, -_LARGE, _LARGE)) for n, v in found.items()})
        except ExpressionError:
            return float("nan")
        return value if abs(value) < _LARGE**0.5 else float(np.copysign(np.inf, value))


def read_sentence(text: str, runs: tuple[str, ...], labels: Collection[str] = ()) -> Sentence:
    """Read a claim's value.

    Parameters
    ----------
    text : str
    runs : tuple of str
        Names of the runs; the first one is meant where a name in quotes has no run and there is only one.
    labels : collection of str
        Those of observers, which are known without quotes where they are identifiers.

    Raises
    ------
    ExpressionError
    """
    quantities: list[Quantity] = []

    def taken_out(match: re.Match[str]) -> str:
        quantity = quantity_of(match, runs)
        if quantity not in quantities:
            quantities.append(quantity)
        return f"q{quantities.index(quantity)}"

    rest = CALL.sub(taken_out, quoted(text, labels))
    if not quantities:
        raise ExpressionError(f"expected quantities such as rmse('label', x1) in it, found {text!r}")
    if "'" in rest:
        raise ExpressionError(f"a name in quotes stands outside a quantity's parentheses: {rest!r}")
    return Sentence(tuple(quantities), parse(rest, names=[f"q{i}" for i in range(len(quantities))]))
