"""Expressions in text: a small grammar on Python's ``ast``, evaluated as floats or as CasADi symbols."""

from __future__ import annotations

import ast
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING

from hgorun.config.evaluation import Value, evaluate
from hgorun.config.grammar import Call, Comparison, Node, Reader, finite, syntax_tree
from hgorun.config.nearest import nearest
from hgorun.config.tokens import CONSTANTS, FUNCTIONS, MAX_LENGTH, NUMBER, ExpressionError, check_name, short, tokens

if TYPE_CHECKING:
    import casadi

__all__ = ["CONSTANTS", "FUNCTIONS", "Expression", "ExpressionError", "check_name", "nearest", "parse"]

_JOINING = ("and", "or", "not")
_NO_VALUES: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class Expression:
    """An expression that `parse` has understood.

    Parameters
    ----------
    text : str
        As it was written.
    names : frozenset of str
        The names that need a value; `pi` and `e` only where they were declared as names.
    tree : Node
        What the text says.
    """

    text: str
    names: frozenset[str]
    tree: Node = field(repr=False, compare=False)

    @property
    def is_condition(self) -> bool:
        """Whether it is true or false, by a comparison or what joins some."""
        return isinstance(self.tree, Comparison) or (isinstance(self.tree, Call) and self.tree.operation in _JOINING)

    def number(self, values: Mapping[str, float] = _NO_VALUES) -> float:
        """Return the value as a finite float.

        Raises
        ------
        ExpressionError
            A value is missing or not finite, or an operation overflows, divides by zero or has no real value.
        """
        value = self._evaluate(values)
        if not isinstance(value, float):
            raise ExpressionError(f"`{short(self.text)}`: a value is not a number")
        return value

    def symbol(self, values: Mapping[str, Value] = _NO_VALUES) -> casadi.SX:
        """Return the expression in CasADi; ``values`` are scalar SX or numbers, and numbers are folded."""
        import casadi

        return casadi.SX(self._evaluate(values))

    def _evaluate(self, values: Mapping[str, Value]) -> Value:
        try:
            return evaluate(self.tree, values)
        except ExpressionError as error:
            raise ExpressionError(f"`{short(self.text)}`: {error}") from None


def parse(value: str | int | float, *, names: Collection[str] | None = None) -> Expression:
    """Read an expression.

    Parameters
    ----------
    value : str, int or float
        Its text, or a number.
    names : collection of str, optional
        The names that may occur besides `pi` and `e`, which they may shadow; any name by default.

    Raises
    ------
    ExpressionError
        The text is not in the grammar, or uses a name that is not in ``names``.
    """
    if isinstance(value, bool) or not isinstance(value, (str, Real)):
        found = f"the truth value {value}" if isinstance(value, bool) else type(value).__name__
        raise ExpressionError(f"expected a number or an expression, found {found}")
    if not isinstance(value, str):
        number = finite(value, f"the number {value}")
        return Expression(str(value) if isinstance(value, int) else repr(number), frozenset(), number)
    text = value.strip(" \t")
    if not text:
        raise ExpressionError("the expression is empty")
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text):,} characters; {MAX_LENGTH:,} are the limit")
    return _read(text, None if names is None else frozenset(names))


@lru_cache(maxsize=1024)
def _read(text: str, names: frozenset[str] | None) -> Expression:
    reader = Reader(names)
    try:
        # what is a single number, as most values of a configuration are, needs no parser
        tree = finite(text, text) if NUMBER.fullmatch(text) else reader.read(_understood(text), 0)
    except ExpressionError as error:
        said = f"`{short(text)}`"
        raise ExpressionError(str(error) if str(error).startswith(f"{said} ") else f"{said}: {error}") from None
    return Expression(text, frozenset(reader.used), tree)


@lru_cache(maxsize=64)  # a text is read twice: when its block is checked, and when its names are known
def _understood(text: str) -> ast.expr:
    return syntax_tree(tokens(text))
