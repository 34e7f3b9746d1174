"""The graph of an expression."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

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


def apart_from(u: ca.SX, z: ca.SX, build: Callable[[ca.SX], ca.SX]) -> ca.SX:
    """What is built from u as if u did not depend on z: slopes in z that are taken on the way leave those of u out.

    Parameters
    ----------
    u, z : casadi.SX
        Such as inputs, of which a law of the estimate gives some, and the states.
    build : callable
        From inputs to an expression.
    """
    if not ca.depends_on(u, z):
        return build(u)
    own = ca.SX.sym("u", *u.shape)
    given = [own[i] if ca.depends_on(one, z) else one for i, one in enumerate(ca.vertsplit(u))]
    return ca.substitute(build(ca.vertcat(*given)), own, u)
