"""The memory of a run: the arrays that native code reads and writes, and the context that points to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hgorun.engine.allowance import SMALL
from hgorun.engine.history import piece_words
from hgorun.engine.history_room import history_pieces
from hgorun.engine.layout import ACTION_WORDS, CONTEXT, SPAN, WORD, HybridSystem
from hgorun.engine.plan import Floats, Kept, PartNumbers, Plan, Segments
from hgorun.engine.window import Window
from hgorun.memo import Memo, same
from hgorun.native.compiler import address_of


@dataclass(frozen=True, eq=False, repr=False)
class Tolerance:
    """Control of an adaptive method.

    Attributes
    ----------
    rtol : float
        Of a state's size, per step.
    atol : float or None
        What is allowed besides; None: it follows from each state's own size, see :mod:`hgorun.engine.allowance`.
    max_step, first_step : float
        The longest step, and the one that is tried first.
    """

    rtol: float
    atol: float | None
    max_step: float
    first_step: float


@dataclass(frozen=True, eq=False, repr=False)
class Start:
    """Where a run starts, for every lane.

    Attributes
    ----------
    z : ndarray, shape (states, lanes)
    p : ndarray, shape (parameters, lanes)
    bound : (offset, factor)
        An observer has diverged beyond offset + factor * max |x| so far; without a plant, of samples that arrived.
    w : ndarray, shape (held numbers, lanes), optional
        What is held, where the run goes on from another one.
    largest : float
        What max |x|, or the largest sample, is at least.
    """

    z: Floats
    p: Floats
    bound: tuple[float, float] = (1e6, 1e6)
    w: Floats | None = None
    largest: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Raw:
    """The result of a run, its lanes in the last axis.

    Attributes
    ----------
    rows : ndarray, shape (grid points, states, lanes)
        None of them where they were handed on.
    measured : ndarray, shape (slots, lanes)
        Of a run whose parts have numbers of their own, what is kept.
    diverged : ndarray, shape (observers, lanes)
        Time of divergence, infinity where there was none.
    error : ndarray, shape (states, lanes)
        Largest local error estimate of an embedded method, zeros otherwise.
    held : ndarray, shape (held numbers, lanes)
        The vector w at the end.
    tries : int
        Steps made, and, where they are controlled, those that were rejected.
    innovations : ndarray, shape (slots, noted, lanes)
        Of every sample when it arrived C xhat - y of each observer, where the system keeps them; empty otherwise.
        Behind them the variance of each one's C xhat, where it keeps these as well.
    largest : float
        What the bound follows from at the end, of all lanes.
    """

    rows: Floats
    measured: Floats
    diverged: Floats
    error: Floats
    held: Floats
    tries: int = 0
    innovations: Floats = field(default_factory=lambda: np.zeros((0, 0, 1)))
    largest: float = 0.0


def _pieces(plan: Plan, tolerance: Tolerance | None) -> int:
    steps = None if tolerance else plan.counts[:, 2] - plan.counts[:, 1]
    return history_pieces(plan.spans[:, :2], steps, plan.reach)


_ENDLESS: Memo[Floats] = Memo(8, lambda grid: grid.size < 1_000_000)  # grids with an end that is never reached


class Memory:
    """The arrays of one run and the context that points to them."""

    def __init__(
        self,
        s: HybridSystem,
        lanes: int,
        constants: int,
        plan: Plan,
        start: Start,
        tolerance: Tolerance | None,
        shown: int | None = None,
        own_words: int = 1,
        window: Window | None = None,
    ) -> None:
        channels = s.outputs * s.width
        pieces = _pieces(plan, tolerance) if s.remembers else 1
        ring = np.zeros(pieces * piece_words(channels, lanes) if s.remembers else 1)
        entries = np.array([e * lanes + lane for row in s.alpha for e in row for lane in range(lanes)], dtype=np.int64)
        self.shape = (0 if window else plan.grid.size, s.states if shown is None else shown, lanes)
        every = plan.advance is not None  # sample is taken and arrives, so that all that is kept of them is written
        if window:
            grid, rows = window.grid, window.rows
        else:
            grid = _ENDLESS.get(same(plan.grid), lambda: np.append(plan.grid, np.inf))
            rows = np.empty(self.shape)  # every row is written, by the native code or at the end
        self.arrays: dict[str, np.ndarray] = {
            "p": np.ascontiguousarray(start.p, dtype=float),
            "c": np.zeros(max(constants, 1) * lanes),
            "z": np.ascontiguousarray(start.z, dtype=float).copy(),
            "w": np.zeros(s.held.size * lanes) if start.w is None else start.w.ravel().copy(),
            "channels": np.zeros(max(channels, 1) * lanes),
            "grid": grid,
            "rows": rows,
            "slots": (np.empty if every else np.zeros)(max(plan.slots, 1) * s.width * lanes),
            "gain": _spread(plan.gain, lanes),
            "bias": _spread(plan.bias, lanes),
            "measured": _unknown((max(plan.slots, 1), lanes), written=every),
            "holds": _spread(plan.holds, lanes),
            "alpha": entries if entries.size else np.zeros(1, dtype=np.int64),
            "blocks": np.array(s.blocks or [(0, 0, 0)], dtype=np.int64),
            "diverged": np.full((max(s.observers, 1), lanes), np.inf),
            "lost": np.full(lanes, np.inf),
            "awaited": np.zeros((max(s.observers, 1), lanes)),
            "largest": np.abs(start.z[: s.plant_states]).max(axis=0, initial=start.largest),
            "ring": ring,
            "initial": np.zeros(max(channels, 1) * lanes),
            "hints": np.zeros(max(s.outputs, 1) * lanes, dtype=np.int64),
            "error": np.zeros((s.states, lanes)),
            "snapshots": np.zeros(max(plan.snapshots * s.snapshot, 1) * lanes),
            "size": _sizes(start.z),
            "own": np.zeros(own_words * lanes, dtype=np.int64),
            "innovations": _unknown((plan.slots if s.innovations else 1, max(s.noted, 1), lanes), written=every),
        }
        self.slots, self.observers, self._width = plan.slots, s.observers, s.width
        self.context = np.zeros(len(CONTEXT), dtype=np.int64)
        for name, array in self.arrays.items():
            self.context[WORD[name]] = address_of(array)
        self.context[WORD["ring_mask"]] = pieces - 1
        reals = self.context.view(float)
        reals[WORD["bound_offset"]], reals[WORD["bound_factor"]] = start.bound
        reals[WORD["t_start"]] = plan.spans.flat[0]
        if tolerance:
            for word, value in (
                ("rtol", tolerance.rtol),
                ("atol", tolerance.atol or 0.0),
                ("small", SMALL if tolerance.atol is None else 0.0),
                ("max_step", tolerance.max_step),
                ("step", tolerance.first_step),
            ):
                reals[WORD[word]] = value
        self._measured = np.full((plan.kept, lanes), np.nan) if plan.numbers else None
        self._kept: tuple[Kept, ...] = ()
        self._room = plan.slots
        self.window = window
        if window:
            self["room"], self["full"] = window.room, window.address
            window.counts_in(self.context[WORD["row"] : WORD["row"] + 1])
        self.take(next(plan.parts()))
        self.address = address_of(self.context)

    def __getitem__(self, word: str) -> int:
        return int(self.context[WORD[word]])

    def __setitem__(self, word: str, value: int) -> None:
        self.context[WORD[word]] = value

    def real(self, word: str) -> float:
        return float(self.context.view(float)[WORD[word]])

    def stop_without(self, observers: Sequence[int]) -> None:
        """End the run when nothing is left of some observers; see :meth:`Program.run`."""
        self.arrays["awaited"][list(observers)] = 1.0
        self["awaits"] = int(bool(observers))

    def take(self, segments: Segments) -> None:
        """The segments that are carried out next."""
        self["segment"] = 0
        nothing = np.zeros(ACTION_WORDS, dtype=np.int64)
        actions = segments.actions if segments.actions.size else nothing
        advance = nothing if segments.advance is None else segments.advance
        tables = {"spans": segments.spans, "counts": segments.counts, "actions": actions, "advance": advance}
        for name, array in tables.items():
            self.put(name, array)
        cut = len(segments.counts) - 1
        own = (len(SPAN), 2, -1, 0, 0) if segments.advance is None else (1, 0, cut, ACTION_WORDS, cut)
        for name, word in zip(("span_words", "inside", "count_mask", "advance_words", "shift"), own, strict=True):
            self[name] = word
        if segments.numbers is not None:
            self._take_numbers(segments.numbers)

    def _take_numbers(self, numbers: PartNumbers) -> None:
        """What is measured next, in place of what has been, some of which is kept."""
        self._keep_measured()
        self._kept = numbers.kept
        lanes, slots = self.shape[2], numbers.gain.size
        for name in ("gain", "bias", "holds"):
            self.put(name, _spread(getattr(numbers, name), lanes))
        if slots > self._room:  # all samples of a part arrive in it, so nothing is on its way
            self._room = slots
            self.put("slots", np.zeros(slots * self._width * lanes))
            self.put("measured", np.full((slots, lanes), np.nan))

    def _keep_measured(self) -> None:
        for one in self._kept:
            assert self._measured is not None
            self._measured[one.places] = self.arrays["measured"][one.slots]

    def put(self, name: str, array: np.ndarray) -> None:
        """Let the native code read and write another array."""
        self.arrays[name] = np.ascontiguousarray(array)
        self[name] = address_of(self.arrays[name])

    def keep_initial(self) -> None:
        """The channels before the start are those at the start."""
        self.arrays["initial"][:] = self.arrays["channels"]

    def result(self, tries: int) -> Raw:
        rows = self.arrays["rows"]
        if self.window:
            self.window.finish(self.arrays["z"].reshape(-1))
            rows = np.empty(self.shape)
        else:
            done = int(self.context[WORD["row"]])
            rows[done:] = self.arrays["z"].reshape(1, *self.shape[1:])  # the points at the end of the run
        self._keep_measured()
        return Raw(
            rows,
            self.arrays["measured"][: self.slots] if self._measured is None else self._measured,
            self.arrays["diverged"][: self.observers],
            self.arrays["error"],
            self.arrays["w"].reshape(-1, self.shape[2]),
            tries,
            self.arrays["innovations"],
            float(np.max(self.arrays["largest"])),
        )


def _sizes(z: Floats) -> Floats:
    """|z| where it is a number, zero elsewhere."""
    sizes: Floats = np.abs(np.ascontiguousarray(z, dtype=float))
    sizes[~np.isfinite(sizes)] = 0.0
    return sizes


def _unknown(shape: tuple[int, ...], *, written: bool) -> Floats:
    """NaN; anything where all numbers are ``written`` before they are read."""
    return np.empty(shape) if written else np.full(shape, np.nan)


def _spread(values: Floats, lanes: int) -> Floats:
    """One number a row for all lanes, or a row of lanes."""
    values = values if values.size else np.zeros(1)
    if values.ndim == 1:
        values = values[:, None] if lanes == 1 else np.repeat(values[:, None], lanes, axis=1)
    return np.ascontiguousarray(values, dtype=float)
