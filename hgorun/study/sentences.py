"""The values of claims: expressions of quantities.

A value is an expression such as ``hf('te02/FHGO I', x3) / hf('te02/SHGO', x3)``. The quantities are taken out and
measured; what remains is an expression of numbers, read by the grammar of all configurations.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.config.expressions import Expression, ExpressionError, nearest, parse
from hgorun.result.quantities import CALL, kinds, quantity_of
from hgorun.result.quantity import Quantity

_BARE = re.compile(r"\b([A-Za-z_]\w*)\s*\(((?:\s*'[^']*'\s*,)*)\s*([^\s'\"(),][^'\"(),]*?)\s*(?=[,)])")
_PAIRS = re.compile(r"'[^']*'|\"([^\"']*)\"")
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

    text = _PAIRS.sub(lambda match: match[0] if match[1] is None else f"'{match[1]}'", text)
    rest = CALL.sub(taken_out, _quoted(text, labels))
    if not quantities:
        raise ExpressionError(f"expected quantities such as rmse('label', x1) in it, found {text!r}")
    if "'" in rest:
        raise ExpressionError(f"a name in quotes stands outside a quantity's parentheses: {rest!r}")
    return Sentence(tuple(quantities), parse(rest, names=[f"q{i}" for i in range(len(quantities))]))


def _quoted(text: str, labels: Collection[str]) -> str:
    """The same with quotes around labels that stand where a quantity has names: nothing else can be meant there.

    Raises
    ------
    ExpressionError
        Where something else stands there.
    """
    before = ""
    while before != text:  # a quantity of two observers has two
        before, text = text, _BARE.sub(lambda match: _with_quotes(match, labels), text)
    return text


def _with_quotes(call: re.Match[str], labels: Collection[str]) -> str:
    """A call up to its first name without quotes, with quotes."""
    kind, (function, quoted, name) = kinds().get(call[1]), call.groups()
    if kind is None or kind.of_plant or quoted.count("'") // 2 >= kind.names:
        return call[0]
    right = f"{function}({quoted} '{name}'" if quoted else f"{function}('{name}'"
    if name.isidentifier() and kind.takes(name, labels):
        return right
    if quoted and name not in labels:  # a state, it may be
        return call[0]
    near = nearest(name, labels) if name not in labels else ""
    known = f"{near} Known: {', '.join(labels)}" if labels else ""
    raise ExpressionError(
        f"{call[0]}, ...): {name!r} is no observer's label that may be without quotes; names with a run, or of other "
        f"characters than letters and digits, stand in quotes: {right}, ...).{known}"
    )
