"""How a system's numbers lie in memory, shared by the native code and the Python that calls it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

# Words of the context, the one argument of the native functions: addresses of arrays, then scalars.
CONTEXT = (
    "p", "c", "z", "w", "channels", "spans", "counts", "actions", "grid", "rows", "slots", "gain", "bias",
    "measured", "holds", "alpha", "blocks", "diverged", "largest", "ring", "initial", "hints", "error",
    "row", "ring_count", "ring_mask", "bound_offset", "bound_factor", "t_start", "rtol", "atol", "max_step",
    "step", "now", "budget", "segment", "paused", "hopeless",
)  # fmt: skip
WORD = {name: index for index, name in enumerate(CONTEXT)}

# One segment between two events: times and evaluation times of its ends, and its integers.
SPAN = ("start", "end", "start_eval", "end_eval")
COUNT = ("steps", "first", "last", "variant", "action_first", "action_last", "end_slope")

# What happens at an event, one row of integers each.
ACTION_WORDS = 5
TAKE, ARRIVE, RECORD, SET, REBASE, JUMP = range(6)

# What the native loop returns.
DONE, PLANT_DIVERGED, HISTORY_TOO_SHORT, STEP_TOO_SMALL, PAUSED = range(5)

# An output's numbers in w, followed by s of each observer.
NOISE, PREVIOUS, OUTPUT, BEFORE_S = range(4)

# What an output is to the observers in a stretch of time.
SILENT, CONTINUOUS, HELD, DELAYED = range(4)
Variant = tuple[tuple[int, int], ...]  # for each output: what it is, and in which phase


def is_delayed(variant: Variant) -> bool:
    """Whether some output is continuous and late."""
    return any(what == DELAYED for what, _ in variant)


@dataclass(frozen=True)
class Structure:
    """Everything that the native code is generated from.

    The state z is the plant's states, then a block for each observer, whose last q entries are its
    alpha where ``has_alpha``. The vector w has for each output: the held random noise, the sample before,
    the output as held or delayed, and for each observer s = C xhat - alpha as held or delayed; its last
    entry is the time between the last two samples. The channels are, for each output, the plant's
    noise-free output and each observer's s.

    Attributes
    ----------
    states, plant_states, held, parameters, outputs, observers : int
        Sizes of z, of its plant part, of w and of p; numbers of outputs and observers.
    blocks : tuple of (start, stop, end)
        Each observer's states in z: [start, stop) are watched for divergence, [stop, end) is alpha.
    flows : mapping of variant to casadi.Function
        z' for each combination of what the outputs are (SILENT, CONTINUOUS, HELD, DELAYED).
    lags : mapping of variant to casadi.Function
        The delays of all outputs at t, where one of them is DELAYED.
    channels : casadi.Function
        The channels from (t, p, z, w).
    jumps : tuple of (start, stop, casadi.Function)
        What z[start:stop] becomes, from (t, p, z, w), when a sample arrives: the plant's where it is stepped,
        then those of the discrete-time observers.
    channel_slopes : casadi.Function
        The channels, then their time derivatives, from (t, p, z, z').
    """

    states: int
    plant_states: int
    held: int
    parameters: int
    outputs: int
    observers: int
    has_alpha: bool
    blocks: tuple[tuple[int, int, int], ...]
    flows: Mapping[Variant, ca.Function]
    lags: Mapping[Variant, ca.Function]
    channels: ca.Function
    channel_slopes: ca.Function
    jumps: tuple[tuple[int, int, ca.Function], ...] = ()

    @property
    def variants(self) -> tuple[Variant, ...]:
        """The variants in the order of their numbers in the segment table."""
        return tuple(self.flows)

    @property
    def width(self) -> int:
        """Channels of one output."""
        return 1 + self.observers

    @property
    def remembers(self) -> bool:
        """Whether a continuous delay needs the history of the channels."""
        return bool(self.lags)

    @property
    def held_width(self) -> int:
        """Numbers of one output in w."""
        return BEFORE_S + self.observers
