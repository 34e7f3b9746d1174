"""How a system's numbers lie in memory, shared by the native code and the Python that calls it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

# Words of the context, the one argument of the native functions: addresses of arrays, then scalars.
CONTEXT = (
    "p", "c", "z", "w", "channels", "spans", "counts", "actions", "grid", "rows", "slots", "gain", "bias",
    "measured", "holds", "alpha", "blocks", "diverged", "lost", "largest", "ring", "initial", "hints", "error", "size",
    "own", "row", "ring_count", "ring_mask", "bound_offset", "bound_factor", "t_start", "rtol", "atol", "small",
    "max_step", "step", "now", "budget", "segment", "paused", "hopeless", "leapt", "snapshots", "innovations",
    "room", "full", "awaited", "awaits", "stopped", "span_words", "inside", "count_mask", "advance", "advance_words",
    "shift",
)  # fmt: skip
WORD = {name: index for index, name in enumerate(CONTEXT)}

# One segment between two events: times and evaluation times of its ends, and its integers. How far it is from the times
# of one segment to those of the next, and to those of evaluation, the context says, and which bits of its number are
# that of its integers: of segments that are alike nothing but times is told of each.
SPAN = ("start", "end", "start_eval", "end_eval")
COUNT = ("steps", "first", "last", "regime", "action_first", "action_last", "end_slope")

# What happens at an event, one row of integers each.
ACTION_WORDS = 5
TAKE, ARRIVE, RECORD, SET, REBASE, JUMP, SAVE, RESTORE, RETAKE, SHOW, HEAR = range(11)
NOTHING = -1

# What the native loop returns.
DONE, PLANT_DIVERGED, HISTORY_TOO_SHORT, STEP_TOO_SMALL, PAUSED = range(5)


@dataclass(frozen=True, eq=False, repr=False)
class Held:
    """Where everything lies in w, the vector of what changes at events only.

    For each output the held part of its noise, the sample before, the output as held or delayed, and each
    observer's s = C xhat - alpha as held or delayed; for each recorded input its value, its slope, the time from
    which they hold, and its value at the sample before; where something is corrected by some outputs at a time
    (``flags``), for each output whether a sample arrives just now; last the time between the last two samples.
    """

    outputs: int
    observers: int
    inputs: int = 0
    flags: bool = False

    PREVIOUS, OUTPUT, S = 1, 2, 3  # places of an output's numbers; its noise comes first

    @property
    def width(self) -> int:
        """Numbers of one output."""
        return self.S + self.observers

    @property
    def size(self) -> int:
        """Numbers in w."""
        return self.outputs * self.width + 4 * self.inputs + self.flags * self.outputs + 1

    def noise(self, output: int) -> int:
        """Held noise of an output."""
        return output * self.width

    def previous(self, output: int) -> int:
        """The sample before."""
        return output * self.width + self.PREVIOUS

    def output(self, output: int) -> int:
        """The output as held or delayed; each observer's s follows."""
        return output * self.width + self.OUTPUT

    def s(self, output: int, observer: int) -> int:
        """An observer's s as held or delayed."""
        return output * self.width + self.S + observer

    def input(self, number: int) -> tuple[int, int, int, int]:
        """A recorded input: value, slope, since when, and the value at the sample before."""
        first = self.outputs * self.width + 4 * number
        return first, first + 1, first + 2, first + 3

    def fresh(self, output: int) -> int:
        """Whether a sample of an output arrives just now."""
        return self.outputs * self.width + 4 * self.inputs + output

    @property
    def interval(self) -> int:
        """The time between the last two samples."""
        return self.size - 1


@dataclass(frozen=True, eq=False, repr=False)
class Decision:
    """What some states become at the end of every step and after every event.

    Attributes
    ----------
    places : tuple of int
        The states, in z.
    function : casadi.Function
        Their values, from (t, p, z, w).
    """

    places: tuple[int, ...]
    function: ca.Function


@dataclass(frozen=True, eq=False, repr=False)
class Regime:
    """The right-hand side while every output stays what it is to the observers.

    Attributes
    ----------
    flow : casadi.Function
        z' from (t, p, z, w).
    lags : casadi.Function or None
        The delays of all outputs at t, from the same, where one of them is continuous and delayed.
    delayed : tuple of int
        The outputs that are.
    decision : Decision or None
        What is decided meanwhile.
    """

    flow: ca.Function
    lags: ca.Function | None = None
    delayed: tuple[int, ...] = ()
    decision: Decision | None = None

    @property
    def deciding(self) -> frozenset[int]:
        """The states that are decided and that the flow depends on."""
        if self.decision is None:
            return frozenset()
        read = set(self.flow.jac_sparsity(0, 2).get_col())
        return frozenset(read.intersection(self.decision.places))


@dataclass(frozen=True, eq=False, repr=False)
class HybridSystem:
    """Everything that the native code is generated from.

    The state z is the plant's states, then a block for each observer, whose last entries are its alpha where
    ``has_alpha``. The channels are, for each output, the plant's noise-free output and each observer's s.

    Attributes
    ----------
    states, plant_states, parameters : int
        Sizes of z, of its plant part and of p.
    held : Held
        The layout of w.
    blocks : tuple of (start, stop, end)
        Each observer's states in z: [start, stop) are watched for divergence, [stop, end) is alpha.
    alpha : tuple of tuple of int
        For each output the place in z of every observer's alpha; without delays and samples, nothing.
    regimes : tuple of Regime
        In the order of their numbers in the segment table.
    channels : casadi.Function
        The channels from (t, p, z, w).
    jumps : tuple of (start, stop, casadi.Function)
        What z[start:stop] becomes, from (t, p, z, w), when a sample arrives: the plant's where it is stepped,
        then those of the discrete-time observers; then the inputs when a controller acts, and as they are kept; at last
        those of the observers that are corrected.
    acts, keeps : int
        How many of the jumps are a controller's, and how many keep its inputs at every sample.
    corrections : tuple of (number, first output, last output + 1)
        Those of the jumps that are made whenever a sample of some of the outputs arrives; the first ones are from
        the second sample on.
    replayed : (int, int) or None
        From where on the states and what is held can be taken back to what they have been.
    channel_slopes : casadi.Function
        The channels, then their time derivatives, from (t, p, z, z'); used where something is delayed.
    innovations : bool
        Whether every observer's innovation is kept of every sample that arrives.
    spreads : casadi.Function or None
        Of every output, for each observer, what is kept beside its innovation, from (t, p, z, w): the variance of what
        it says of the output.
    recalled : int
        How many of the outputs, the last ones, are none: they stand for signals of observers that look back at their
        own past, which are their first channel.
    """

    states: int
    plant_states: int
    parameters: int
    held: Held
    blocks: tuple[tuple[int, int, int], ...]
    alpha: tuple[tuple[int, ...], ...]
    regimes: tuple[Regime, ...]
    channels: ca.Function
    channel_slopes: ca.Function
    jumps: tuple[tuple[int, int, ca.Function], ...] = ()
    acts: int = 0
    keeps: int = 0
    corrections: tuple[tuple[int, int, int], ...] = ()
    replayed: tuple[int, int] | None = None
    innovations: bool = False
    spreads: ca.Function | None = None
    recalled: int = 0

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return self.held.outputs

    @property
    def observers(self) -> int:
        """Number of observers."""
        return len(self.blocks)

    @property
    def noted(self) -> int:
        """How many numbers are kept of a sample that arrives."""
        return self.observers * (2 if self.spreads else 1)

    @property
    def width(self) -> int:
        """Channels of one output."""
        return 1 + self.observers

    @property
    def stepped(self) -> tuple[tuple[int, int, ca.Function], ...]:
        """Those of the jumps that are made from the second sample on."""
        return self.jumps[: len(self.jumps) - self.acts - self.keeps - len(self.corrections)]

    @property
    def acting(self) -> range:
        """The numbers of the jumps that are made when a controller acts."""
        first = len(self.stepped)
        return range(first, first + self.acts)

    @property
    def keeping(self) -> range:
        """The numbers of those that are made at every sample, when all else has happened."""
        return range(self.acting.stop, self.acting.stop + self.keeps)

    @property
    def has_alpha(self) -> bool:
        """Whether the observers compare with the past."""
        return bool(self.alpha)

    @property
    def hears(self) -> bool:
        """Whether a sample that is not late may be taken, arrive and be counted from in one action."""
        return self.innovations and self.has_alpha and self.spreads is None and self.replayed is None

    @property
    def snapshot(self) -> int:
        """How many numbers are kept to go back to them."""
        return 0 if self.replayed is None else self.states - self.replayed[0] + self.held.size - self.replayed[1]

    @property
    def decides(self) -> bool:
        """Whether anything is decided at the ends of steps."""
        return any(regime.decision is not None for regime in self.regimes)

    @property
    def compares_with_past(self) -> bool:
        """Whether observers compare a continuous output with what they have estimated of it before."""
        return any(output < self.outputs - self.recalled for regime in self.regimes for output in regime.delayed)

    @property
    def remembers(self) -> bool:
        """Whether a continuous delay needs the history of the channels."""
        return any(regime.delayed for regime in self.regimes)
