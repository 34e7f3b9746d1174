"""From a CasADi function to LLVM IR: its instruction list, on W lanes.

A function f(t, p, z, w) is split by what its parts depend on. What depends on the parameters p alone is computed
once a run (``setup``), what depends on time and parameters once a time (``clock``; once for all lanes where these have
the same parameters), the rest at every evaluation (``main``). The operations are CasADi's, so a value has the same bits
whatever else the function computes. sin, tanh and the like take long: those that do not wait for each other are
computed side by side in one vector, which changes no bit of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from hgorun.engine.emitter import Emitter
from hgorun.native.ir import Function
from hgorun.symbolic.instructions import CLOCK, read, rounds
from hgorun.symbolic.interpreter import CALLS


@dataclass(eq=False, repr=False)
class Emitted:
    """The three parts of one function, and how much memory their results take.

    ``<name>_setup(p, c)``, ``<name>_clock(t, p, c, tau)``, ``<name>(p, c, tau, z, w, d)``; c and tau hold
    ``constants`` and ``clocked`` values a lane, d the function's output.
    """

    name: str
    lanes: int
    constants: int = 0
    clocked: int = 0
    instructions: int = 0
    timed: bool = False
    text: str = field(default="", repr=False)

    def setup(self, f: Function, p: str, c: str) -> None:
        f.call(f"{self.name}_setup", f"ptr {p}, ptr {c}")

    def clock(self, f: Function, t: str, p: str, c: str, tau: str) -> None:
        if not self.clocked:
            return
        arguments = f"double {t}, ptr {p}, ptr {c}, ptr {tau}"
        if self.timed:
            f.call(f"{self.name}_clock", f"{f.real} {t}, ptr {p}, ptr {c}, ptr {tau}")
            return
        if self.lanes == 1:
            f.call(f"{self.name}_clock", arguments)
            return
        alike = f.test("ne", f.word(c, (self.constants - 1) * self.lanes), "0")
        with f.when(alike):
            f.call(f"{self.name}_clock_alike", arguments)
        with f.when(f.let(f"xor i1 {alike}, true")):
            f.call(f"{self.name}_clock", arguments)

    def main(self, f: Function, p: str, c: str, tau: str, z: str, w: str, d: str) -> None:
        f.call(self.name, f"ptr {p}, ptr {c}, ptr {tau}, ptr {z}, ptr {w}, ptr {d}")


def emit(
    function: ca.Function,
    name: str,
    lanes: int,
    declarations: set[str],
    *,
    inlined: bool = True,
    literal: bool = False,
    timed: bool = False,
) -> Emitted:
    """Emit f(t, p, z, w) -> d.

    Parameters
    ----------
    function : casadi.Function
        Four inputs t (scalar), p, z, w and one dense vector output, on SX.
    name : str
        Prefix of the emitted functions.
    lanes : int
        W; arrays hold W values an entry.
    declarations : set of str
        Receives the intrinsics needed.
    inlined : bool
        Whether the code stands wherever it is called, or once.
    literal : bool
        Every operation by itself, rounded as it is written; otherwise those of every evaluation are taken together
        where that takes less time, see :class:`~hgorun.engine.emitter.Emitter`.
    timed : bool
        Whether each lane has a time of its own.
    """
    emitter = Emitter(name, lanes, declarations, inlined=inlined, timed=timed, literal=literal)
    instructions = read(function)
    for some in rounds(instructions, calls=CALLS):
        if some[0].op in CALLS:
            emitter.calls(some)
            continue
        for i in some:
            if i.op == ca.OP_CONST:
                emitter.constant(i.value, i.number)
            elif i.op == ca.OP_INPUT:
                emitter.input(i.value, *i.place)
            elif i.op == ca.OP_OUTPUT:
                emitter.output(i.arguments[0], i.place[1])
            else:
                emitter.operation(i.value, i.op, i.arguments)
    if lanes > 1 and emitter.sizes[CLOCK] and not timed:
        from hgorun.engine.alike import add_alike

        add_alike(emitter, instructions)
    for part in emitter.parts:
        part.do("ret void")
    return Emitted(
        name,
        lanes,
        emitter.sizes[0],
        emitter.sizes[1],
        len(instructions),
        timed,
        "\n".join(part.text() for part in emitter.parts),
    )
