"""Expressions with their numbers taken out: what is left is structure, the numbers are values of a run.

``0.5*sin(3*t)`` and ``0.7*sin(3*t)`` are one template, ``n0*sin(n1*t)``, with the numbers (0.5, 3) and (0.7, 3).
Parts without names are computed first, so ``2*pi*t`` has one number. Some numbers decide what is computed and
stay in the template: operands of a power (``x**2`` is a product), conditions and truth values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hgorun.config.evaluation import Value, evaluate
from hgorun.config.expressions import Expression
from hgorun.config.grammar import Call, Chain, Comparison, Name, Node

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Template:
    """An expression whose numbers are names.

    Attributes
    ----------
    tree : Node
        Equal for expressions that differ in their numbers only; it can be a key.
    """

    tree: Node

    def symbol(self, values: Mapping[str, Value], numbers: casadi.SX) -> casadi.SX:
        """The expression in CasADi.

        Parameters
        ----------
        values : mapping of str to casadi.SX
        numbers : casadi.SX
            Symbols for the numbers of :func:`template`, in their order.
        """
        import casadi

        return casadi.SX(evaluate(self.tree, {**values, **{_name(i): numbers[i] for i in range(numbers.numel())}}))


def template(expression: Expression) -> tuple[Template, tuple[float, ...]]:
    """An expression without its numbers, and the numbers.

    Raises
    ------
    ExpressionError
        When a part without names has no value, such as ``1/0``.
    """
    numbers: list[float] = []
    return Template(_lifted(expression.tree, numbers)), tuple(numbers)


def _name(i: int) -> str:
    return f"#{i}"  # no name of a configuration


def _taken(value: float, numbers: list[float]) -> Node:
    numbers.append(value)
    return Name(_name(len(numbers) - 1), None)


def _lifted(node: Node, numbers: list[float]) -> Node:
    """The node with the numbers below it replaced by names."""
    if _is_constant(node):
        return _taken(evaluate(node, {}), numbers)
    match node:
        case Comparison(first, rest):
            return Comparison(_lifted(first, numbers), tuple((sign, _lifted(part, numbers)) for sign, part in rest))
        case Chain(first, rest):
            return _chain(first, rest, numbers)
        case Call("where", (condition, a, b)):
            if _is_constant(condition):
                return _lifted(a if evaluate(condition, {}) else b, numbers)
            return Call("where", (_kept(condition, numbers), _lifted(a, numbers), _lifted(b, numbers)))
        case Call("and" | "or" | "not"):
            return node
        case Call(operation, arguments):
            return Call(operation, tuple(_lifted(argument, numbers) for argument in arguments))
    return node


def _kept(node: Node, numbers: list[float]) -> Node:
    """As :func:`_lifted`, but a number that is the whole node stays."""
    return node if _is_constant(node) else _lifted(node, numbers)


def _chain(first: Node, rest: tuple[tuple[str, Node], ...], numbers: list[float]) -> Node:
    """A chain is computed from the left: its first operands are one number as long as they have no names."""
    start = 0
    while start < len(rest) and _is_constant(Chain(first, rest[: start + 1])):
        start += 1
    head = Chain(first, rest[:start]) if start else first
    base = rest[start][0] == "**"
    return Chain(
        (_kept if base else _lifted)(head, numbers),
        tuple((sign, (_kept if sign == "**" else _lifted)(part, numbers)) for sign, part in rest[start:]),
    )


def _is_constant(node: Node) -> bool:
    """Whether a node has no names but those of constants."""
    match node:
        case Name(constant=constant):
            return constant is not None
        case Chain(first, rest):
            return _is_constant(first) and all(_is_constant(part) for _, part in rest)
        case Call(arguments=arguments):
            return all(_is_constant(argument) for argument in arguments)
    return True
