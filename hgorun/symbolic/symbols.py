"""Symbolic expressions by name: ``s.xhat``, ``k.theta``, ``p.mu``."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca


class Symbols:
    """Expressions as attributes; ``vars(symbols)`` gives all of them by name.

    Raises
    ------
    AttributeError
        For an unknown name; the message lists the known ones.
    """

    def __init__(self, values: Mapping[str, ca.SX]) -> None:
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> ca.SX:  # asked for what is not there
        known = ", ".join(vars(self)) or "none"
        raise AttributeError(f"nothing is called {name!r} here; known: {known}")
