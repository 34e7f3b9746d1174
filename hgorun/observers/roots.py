"""Powers of an error, as relays and differentiators take them: of one root, which is faster than each by itself."""

from __future__ import annotations

import casadi as ca


def root(size: ca.SX, n: int) -> ca.SX:
    """size^(1/n), by square and cube roots as far as they go."""
    while n % 2 == 0:
        size, n = ca.sqrt(size), n // 2
    while n % 3 == 0:
        size, n = size ** (1 / 3), n // 3
    return size if n == 1 else size ** (1 / n)


def root_powers(size: ca.SX, n: int) -> list[ca.SX]:
    """size^(j/n), j = n - 1, ..., 1, 0."""
    base, found = root(size, n), [ca.SX(1)]
    for _ in range(n - 1):
        found.insert(0, found[0] * base)
    return found


def signed_powers(s: ca.SX, n: int) -> ca.SX:
    """|s|^(j/n) sign(s), j = n - 1, ..., 1, 0."""
    return ca.vertcat(*root_powers(ca.fabs(s), n)) * ca.sign(s)
