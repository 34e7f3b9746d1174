"""The graph of an expression."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import casadi as ca


def operations(expressions: Iterable[ca.SX]) -> Iterator[ca.SX]:
    """Every operation in the entries of some expressions once, from the last one back."""
    seen: set[int] = set()
    stack = [e[i] for e in expressions for i in range(e.numel())]
    while stack:
        node = stack.pop()
        if not node.is_leaf() and node.element_hash() not in seen:
            seen.add(node.element_hash())
            stack += arguments(node)
            yield node


def arguments(node: ca.SX) -> list[ca.SX]:
    """What an operation is applied to."""
    return [node.dep(i) for i in range(node.n_dep())]
