"""The native functions that write output points between steps."""

from __future__ import annotations

from collections.abc import Iterator

from hgorun.engine.layout import WORD
from hgorun.engine.module import Module
from hgorun.native.ir import Function


def hermite(f: Function, theta: str, h: str, z0: str, k0: str, z1: str, k1: str) -> str:
    """The cubic through (0, z0, k0) and (h, z1, k1) at theta h."""
    rest = f.sub(f.constant(1.0), theta)
    # (1-T) z0 + T z1 + T (T-1) ((1-2T)(z1-z0) + (T-1) h k0 + T h k1): the ends are met to the last bit
    line = f.fma(rest, z0, f.mul(theta, z1))
    ends = f.fma(f.mul(theta, h), k1, f.neg(f.mul(f.mul(rest, h), k0)))
    bend = f.fma(f.sub(rest, theta), f.sub(z1, z0), ends)
    return f.fma(f.neg(f.mul(theta, rest)), bend, line)


def hermite_slope(f: Function, theta: str, h: str, z0: str, k0: str, z1: str, k1: str) -> str:
    """The time derivative of :func:`hermite`."""
    rest = f.sub(f.constant(1.0), theta)
    bump = f.mul(f.constant(3.0), f.mul(theta, rest))
    # with B = 3 T (1-T): 2 B (z1-z0)/h + (1-T-B) k0 + (T-B) k1
    rise = f.div(f.sub(z1, z0), h)
    middle = f.mul(f.mul(f.constant(2.0), bump), rise)
    a = f.mul(f.sub(rest, bump), k0)
    b = f.mul(f.sub(theta, bump), k1)
    return f.add(middle, f.add(a, b))


def add_rows(m: Module, *, quintic: bool) -> None:
    """``rows(ctx, t0, t1, snap, z0, k0, z1, k1, q)``: the output points in [t0 - snap, t1 - snap).

    By the cubic Hermite polynomial, or that plus T^2 (1-T)^2 q, a method's own continuous extension. Where there is
    room for some of them only, ``full(ctx)`` makes room whenever it is taken, see :mod:`hgorun.engine.window`.
    """
    f = m.function(
        "rows",
        "ptr %ctx, double %t0, double %t1, double %snap, ptr %z0, ptr %k0, ptr %z1, ptr %k1, ptr %q",
        attributes="nounwind noinline",
    )
    grid, rows = f.word("%ctx", WORD["grid"], "ptr"), f.word("%ctx", WORD["rows"], "ptr")
    place = f.at("%ctx", WORD["row"])
    h = f.scalar("fsub", "%t1", "%t0")
    start, stop = f.scalar("fadd", "%t0", "%snap"), f.scalar("fsub", "%t1", "%snap")
    with f.loop() as done:
        with f.loop() as after:
            row = f.load(place, "i64")
            t = f.word(grid, row, "double")
            f.leave_if(f.test("oge", t, stop), after)
            target = f.at(rows, f.scalar("mul", row, str(m.row_words)))
            on_step = f.test("ole", t, start)
            with f.when(on_step):
                for source, i in shown(f, m):
                    f.store(f.load(f.at("%z0", source), f.real), f.at(target, i), f.real)
            with f.when(f.let(f"xor i1 {on_step}, true")):
                part = f.scalar("fdiv", f.scalar("fsub", t, "%t0"), h)
                theta, length = f.splat(part), f.splat(h)
                if quintic:
                    bump = f.mul(theta, f.sub(f.constant(1.0), theta))
                    bump = f.mul(bump, bump)
                for source, i in shown(f, m):
                    values = [f.load(f.at(array, source), f.real) for array in ("%z0", "%k0", "%z1", "%k1")]
                    value = hermite(f, theta, length, *values)
                    if quintic:
                        value = f.add(value, f.mul(bump, f.load(f.at("%q", source), f.real)))
                    f.store(value, f.at(target, i), f.real)
            f.store(f.scalar("add", row, "1"), place, "i64")
        # the grid that there is room for ends with a time that is never reached
        full = f.word("%ctx", WORD["full"], "ptr")
        f.leave_if(f.let(f"icmp eq ptr {full}, null"), done)
        f.leave_if(f.test("ne", f.load(place, "i64"), f.word("%ctx", WORD["room"])), done)
        f.do(f"call void {full}(ptr %ctx)")
    f.do("ret void")
    m.finish(f)


def add_row(f: Function, m: Module, z: str) -> None:
    """The next output point has some states; there is room for it."""
    place = f.at("%ctx", WORD["row"])
    row = f.load(place, "i64")
    target = f.at(f.word("%ctx", WORD["rows"], "ptr"), f.scalar("mul", row, str(m.row_words)))
    for k, state in enumerate(range(m.system.states) if m.shown is None else m.shown):
        f.store(f.load(f.at(z, state * m.lanes), f.real), f.at(target, k * m.lanes), f.real)
    f.store(f.scalar("add", row, "1"), place, "i64")


def shown(f: Function, m: Module) -> Iterator[tuple[str, str]]:
    """Places of the states of a row: among all states, and in the row."""
    if m.shown is None:
        with f.count(0, m.system.states) as i:
            place = f.scalar("mul", i, str(m.lanes))
            yield place, place
    else:
        for k, state in enumerate(m.shown):
            yield str(state * m.lanes), str(k * m.lanes)
