"""The compiled loop over members, and the memory of one thread that runs it."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.generate import generate, generate_loose
from hgorun.engine.lane_tables import OWN, TABLES
from hgorun.engine.layout import ACTION_WORDS, HybridSystem
from hgorun.engine.members import INPUTS, JOB, OUTPUTS, PLACE
from hgorun.engine.memory import Memory, Start, Tolerance
from hgorun.engine.plan import Floats, Plan
from hgorun.native.compiler import NativeModule, address_of, vector_doubles
from hgorun.symbolic.instructions import calls_of_state
from hgorun.symbolic.interpreter import CALLS

_FEW_STATES, _FEW_THAT_WAIT = 6, 11


@dataclass(frozen=True, kw_only=True, eq=False)
class Reducer:
    """Native code that makes numbers of the rows of some lanes.

    Attributes
    ----------
    address : int
        Of ``void reduce(int64 *arrays, double *rows, double *found)``.
    arrays : sequence of ndarray
        What it works with, the first one being its argument; each thread has its own.
    size : int
        So many numbers a lane.
    """

    address: int
    arrays: Sequence[np.ndarray]
    size: int


class ManyProgram:
    """Native code that runs members of an ensemble, W of them at a time.

    Parameters
    ----------
    system : HybridSystem
    method : str
        With fixed steps.
    lanes : int
        W.
    shown : sequence of int, optional
        The states of a row, all of them by default.
    loose : bool
        Every member has tables of its own.
    estimates : bool
        Whether embedded error estimates are kept.
    adaptive : bool
        Every member has steps of its own, too, which an error estimate controls.
    """

    def __init__(
        self,
        system: HybridSystem,
        method: str,
        lanes: int,
        shown: Sequence[int] | None = None,
        *,
        loose: bool = False,
        estimates: bool = True,
        adaptive: bool = False,
    ) -> None:
        self.system, self.lanes, self.shown, self.loose = system, lanes, shown, loose or adaptive
        if self.loose:
            ir, self.constants = generate_loose(system, method, lanes, shown, adaptive=adaptive)
        else:
            ir, self.constants = generate(system, method, lanes=lanes, many=True, shown=shown, estimates=estimates)
        self._native = NativeModule(ir, ("members",))
        kinds = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64
        self.members = ctypes.CFUNCTYPE(None, *kinds)(self._native.address["members"])

    @property
    def width(self) -> int:
        """States of a row."""
        return self.system.states if self.shown is None else len(self.shown)


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """Of the steps of members, each of which has its own.

    Attributes
    ----------
    tolerance : Tolerance
    limit : int
        So many steps may be tried.
    """

    tolerance: Tolerance
    limit: int


class Worker:
    """What one thread needs to run blocks of members: the memory of one block, and where members are read and written.

    Parameters
    ----------
    program : ManyProgram
    plan : Plan
    inputs : mapping of str to ndarray, shape (rows, N) or (rows,)
        Of the names in ``INPUTS``, of doubles; ValueError where they are fewer than the plan reads.
    outputs : mapping of str to ndarray, shape (rows, N)
        Of some of the names in ``OUTPUTS``.
    count : int
        N.
    bound : (offset, factor)
        As of :class:`~hgorun.engine.memory.Start`.
    reducer : Reducer, optional
    tables : sequence of Plan
        Of a loose program, the plans of all members, or the one of all; ``plan`` has as many slots and holds as the
        largest.
    control : Control, optional
        Of steps that are controlled.
    """

    def __init__(
        self,
        program: ManyProgram,
        plan: Plan,
        inputs: Mapping[str, Floats],
        outputs: Mapping[str, Floats],
        count: int,
        bound: tuple[float, float],
        reducer: Reducer | None = None,
        tables: Sequence[Plan] = (),
        control: Control | None = None,
    ) -> None:
        s, lanes = program.system, program.lanes
        start = Start(np.zeros((s.states, lanes)), np.zeros((s.parameters, lanes)), bound)
        self._program, self._kept = program, (inputs, outputs, reducer)
        tolerance = control.tolerance if control else None
        self._memory = Memory(s, lanes, program.constants, plan, start, tolerance, program.width, len(OWN))
        if control:
            self._memory["budget"] = control.limit
        self._memory["awaits"] = int(len(inputs["awaited"]) > 0)
        job = np.zeros(len(JOB), dtype=np.int64)
        for name in INPUTS:
            room = self._memory.arrays[name].size // lanes
            array = inputs[name][:room]  # plans with fewer samples than others have numbers that are not read
            if len(array) < min(room, _needed(plan, name)):
                raise ValueError(f"{name} has {len(array)} rows, the plan needs {_needed(plan, name)}")
            strides = [stride // 8 for stride in array.strides]
            strides += [0] * (2 - len(strides))  # the same for all members
            place = PLACE[f"{name}_address"]
            job[place : place + 4] = array.__array_interface__["data"][0], len(array), *strides
        for name in OUTPUTS:
            if name in outputs and outputs[name].size:
                job[PLACE[name]] = address_of(outputs[name])
        job[PLACE["count"]], job[PLACE["segments"]] = count, len(plan.counts)
        job[PLACE["points"]], job[PLACE["slots"]] = plan.grid.size, plan.slots * s.width
        if reducer is not None:
            self._reduced = np.zeros((reducer.size, lanes))
            job[PLACE["reduce"]], job[PLACE["numbers"]] = reducer.address, reducer.size
            job[PLACE["workspace"]], job[PLACE["reduced"]] = address_of(reducer.arrays[0]), address_of(self._reduced)
        if program.loose:
            self._tables, self._plans = _table_of(tables, count)
            job[PLACE["tables"]] = address_of(self._tables)
        self._job = job

    def run(self, first: int, stop: int) -> None:
        """Some of the blocks of W members; the interpreter is free meanwhile."""
        self._program.members(self._memory.address, address_of(self._job), first, stop)


def _needed(plan: Plan, name: str) -> int:
    """So many numbers of each member a plan reads."""
    sizes = {"gain": plan.gain.size, "bias": plan.bias.size, "holds": plan.holds.size}
    return sizes.get(name, 0)


def _table_of(plans: Sequence[Plan], count: int) -> tuple[np.ndarray, list[list[np.ndarray]]]:
    """Where the tables of every member are, shape (members, 4), and these."""
    found = np.empty((len(plans), len(TABLES)), dtype=np.int64)
    kept = []
    for row, plan in zip(found, plans, strict=True):
        actions = plan.actions if plan.actions.size else np.zeros((1, ACTION_WORDS), dtype=np.int64)
        arrays = [np.ascontiguousarray(array) for array in (plan.spans, plan.counts, actions)]
        row[:] = *(array.__array_interface__["data"][0] for array in arrays), len(plan.counts)
        kept.append(arrays)
    return np.repeat(found, count // len(plans), axis=0), kept


def widest(plans: Sequence[Plan]) -> Plan:
    """A plan with room for the samples and held values of each; all have one grid."""
    slots, holds = (max(sizes) for sizes in zip(*((plan.slots, plan.holds.size) for plan in plans), strict=True))
    gain = max(plan.gain.size for plan in plans)
    return replace(plans[0], slots=slots, gain=np.zeros(gain), bias=np.zeros(gain), holds=np.zeros(holds))


def beside(rows: Sequence[Floats]) -> Floats:
    """Numbers of each member, shape (longest, members); zero behind the end of the shorter ones."""
    found = np.zeros((len(rows), max(row.size for row in rows)))
    for own, row in zip(found, rows, strict=True):
        own[: row.size] = row
    return found.T


def lanes_of(system: HybridSystem) -> int:
    """How many members are fastest side by side.

    Where states fit into registers, the instructions of two vectors fill each other's waiting times: Lorenz, of 3
    states, takes 0.69 of the time with 16 lanes, and 0.70 with 32, of what it takes with 8 (AVX-512); with AVX2 0.61
    with 8, and 0.59 with 16, of what it takes with 4. Of more states two vectors only go through memory more often:
    7 states take as long with 16 lanes as with 8, 12 states 1.15 times as long, 17 states 1.4, 23 states 1.0 to 1.1.
    Where every evaluation waits for powers, exponentials and the like it is more states: differentiators of 7 states
    take 0.7 of the time, 11 states with three of them one after the other, too.
    """
    few = system.states <= _FEW_STATES or (
        system.states <= _FEW_THAT_WAIT and any(calls_of_state(one.flow, CALLS) for one in system.regimes)
    )
    return (2 if few else 1) * vector_doubles()
