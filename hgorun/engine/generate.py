"""The whole IR of a system: its functions, the steps of a method, and the loop over the segments of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hgorun.engine.emit import Emitted
from hgorun.engine.events import add_actions, add_channels, add_jumps, add_spreads
from hgorun.engine.fixed import add_fixed
from hgorun.engine.flag import add_flag
from hgorun.engine.history import History
from hgorun.engine.layout import DONE, PAUSED, WORD, HybridSystem
from hgorun.engine.methods import METHODS, Method, Rosenbrock
from hgorun.engine.module import Module, counts, span
from hgorun.engine.rows import add_rows
from hgorun.engine.stepper import Stepper


def generate(
    system: HybridSystem,
    method: str,
    *,
    adaptive: bool = False,
    lanes: int = 1,
    many: bool = False,
    shown: Sequence[int] | None = None,
    estimates: bool = True,
) -> tuple[str, int]:
    """The IR of a system, and how many constants a lane of a run has.

    With the loop over ``many`` members of :mod:`hgorun.engine.members`, and the states that are ``shown`` in rows.
    Embedded error estimates are kept where ``estimates`` says so.
    """
    m, chosen = Module(system, lanes, shown), METHODS[method]
    if not estimates and isinstance(chosen, Method):
        chosen = replace(chosen, error=())
    implicit = isinstance(chosen, Rosenbrock)
    flows = [m.emit(regime.flow, f"flow{i}", inlined=not implicit) for i, regime in enumerate(system.regimes)]
    add_channels(m)
    add_spreads(m)
    add_jumps(m)
    add_actions(m)
    add_flag(m, alone=adaptive or (lanes == 1 and not many))
    add_rows(m, quintic=bool(chosen.dense))
    history = History(m, slopes=implicit) if system.remembers else None
    for i, flow in enumerate(flows):
        name = f"advance{i}"
        stepper = _stepper(m, chosen, history, i, flow, name)
        if adaptive:
            from hgorun.engine.adaptive import add_adaptive

            add_adaptive(stepper)
        else:
            add_fixed(stepper)
    _add_run(m, len(flows))
    m.setup()
    if many:
        from hgorun.engine.members import add_members

        add_members(m)
    return m.text(), m.constants


def generate_loose(
    system: HybridSystem, method: str, lanes: int, shown: Sequence[int] | None, *, adaptive: bool = False
) -> tuple[str, int]:
    """As :func:`generate`, for many members that have tables of their own.

    See :mod:`hgorun.engine.loose`, and :mod:`hgorun.engine.loose_adaptive` where their steps are controlled.
    """
    from hgorun.engine.loose import add_loose
    from hgorun.engine.loose_adaptive import add_loose_adaptive
    from hgorun.engine.members import add_members

    m, chosen = Module(system, lanes, shown, loose=True), METHODS[method]
    implicit = isinstance(chosen, Rosenbrock)
    flows = [m.emit(regime.flow, f"flow{i}", inlined=not implicit) for i, regime in enumerate(system.regimes)]
    add_channels(m)
    add_jumps(m)
    add_flag(m, alone=False)
    if adaptive:
        steppers = [_stepper(m, chosen, None, i, flow, f"try{i}") for i, flow in enumerate(flows)]
        add_loose_adaptive(m, steppers, quintic=bool(chosen.dense))
    else:
        assert isinstance(chosen, Method)
        add_loose(m, chosen, flows)
    add_begin(m)
    m.setup()
    add_members(m)
    return m.text(), m.constants


def _stepper(
    m: Module, method: Method | Rosenbrock, history: History | None, regime: int, flow: Emitted, name: str
) -> Stepper:
    """What makes a step; only what is asked for is imported, for most runs are short."""
    if isinstance(method, Rosenbrock):
        from hgorun.engine.rosenbrock import LinearlyImplicit

        return LinearlyImplicit(m, method, history, regime, flow, name)
    from hgorun.engine.runge_kutta import RungeKutta

    return RungeKutta(m, method, history, regime, flow, name)


def _add_run(m: Module, regimes: int) -> None:
    """``run(ctx, stop)``: go on to segment ``stop``."""
    f = m.function("run", "ptr %ctx, i64 %stop", returns="i64")
    verdict, at, paused = f.slot("i64"), f.at("%ctx", WORD["segment"]), f.at("%ctx", WORD["paused"])
    leave = f.label()
    f.store(str(DONE), verdict, "i64")
    with f.loop() as after:
        segment = f.load(at, "i64")
        f.leave_if(f.test("sge", segment, "%stop"), after)
        n = counts(f, segment)
        with f.when(f.test("eq", f.load(paused, "i64"), "0")):
            f.store(span(f, segment)[0], f.at("%ctx", WORD["now"]))
            with f.when(f.test("ne", n["action_first"], n["action_last"])):
                f.call("act", f"ptr %ctx, i64 {segment}")
        f.store("0", paused, "i64")
        for i in range(regimes):
            with f.when(f.test("eq", n["regime"], str(i))):
                f.store(f.call(f"advance{i}", f"ptr %ctx, i64 {segment}", "i64"), verdict, "i64")
        f.leave_if(f.test("ne", f.load(verdict, "i64"), str(DONE)), leave)
        f.store(f.scalar("add", segment, "1"), at, "i64")
    f.jump(leave)
    f.place(leave)
    stopped = f.load(verdict, "i64")
    f.store(f.let(f"zext i1 {f.test('eq', stopped, str(PAUSED))} to i64"), paused, "i64")
    f.do(f"ret i64 {stopped}")
    m.finish(f, "dso_local")
    add_begin(m)


def add_begin(m: Module) -> None:
    """``begin(ctx)``: what depends on parameters alone, and the channels at the start."""
    g = m.function("begin", "ptr %ctx")
    g.call("setup", "ptr %ctx")
    g.call("channels", f"ptr %ctx, double {g.word('%ctx', WORD['t_start'], 'double')}")
    g.do("ret void")
    m.finish(g, "dso_local")
