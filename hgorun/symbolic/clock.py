"""Time counted from the start of a run, which keeps the digits that a clock of long ago would take."""

from __future__ import annotations

import casadi as ca


def on_the_clock(t: ca.SX, origin: float) -> ca.SX:
    """What the clock of a configuration shows when t has passed since its ``origin``."""
    return t + origin if origin else t
