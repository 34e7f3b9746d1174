"""Divergence: what looks for it after every step, and the native function that masks what is lost."""

from __future__ import annotations

from hgorun.engine.layout import WORD
from hgorun.engine.module import Module, lent, move
from hgorun.native.ir import Function


def guard(f: Function, m: Module, t: str, z: str, lost: str) -> None:
    """Grow the largest |x| so far and mask what has left the bound; leave to ``lost`` with the plant."""
    s, lanes = m.system, m.lanes
    largest_at = f.word("%ctx", WORD["largest"], "ptr")
    largest = f.load(largest_at, f.real)
    sizes = [f.intrinsic("fabs", f.load(f.at(z, i * lanes), f.real)) for i in range(s.states)]
    for i in range(s.plant_states):
        largest = f.select(f.compare("ogt", sizes[i], largest), sizes[i], largest)
    f.store(largest, largest_at, f.real)
    bound = f.add(
        f.splat(f.word("%ctx", WORD["bound_offset"], "double")),
        f.mul(f.splat(f.word("%ctx", WORD["bound_factor"], "double")), largest),
    )
    limit = f.constant(1e300)
    bad = [f.compare("ugt", sizes[i], limit) for i in range(s.plant_states)]
    bad += [f.compare("ugt", sizes[i], bound) for start, stop, _ in s.blocks for i in range(start, stop)]
    while len(bad) > 1:  # a tree: short chains of dependence
        pairs = [f.let(f"or {f.mask} {a}, {b}") for a, b in zip(bad[::2], bad[1::2], strict=False)]
        bad = pairs + bad[len(bad) - len(bad) % 2 :]
    with f.when(f.any(bad[0])):
        bounds = f.slot("double", lanes)
        f.store(bound, bounds, f.real)
        masked = lent(f, z, s.states)
        verdict = f.call("flag", f"ptr %ctx, {m.time} {t}, ptr {masked}, ptr {bounds}", "i64")
        move(f, masked, z, s.states)
        f.leave_if(f.test("eq", verdict, "1"), lost)


def add_flag(m: Module, *, alone: bool) -> None:
    """``flag(ctx, t, z, bound)``: mask the observers that have left the bound; 1 when the run ends.

    It ends with the plant; one that is not ``alone`` does not end the run of the others: all its lane becomes NaN, and
    when that was is kept in ``lost``. It also ends where some observers are ``awaited`` and all of them have been
    masked in the steps before, in every lane: what is not a number is looked at in every step.
    """
    lanes = m.lanes
    arguments = f"ptr %ctx, {m.time} %t, ptr %z, ptr %bound"
    f = m.function("flag", arguments, returns="i64", attributes="nounwind noinline")
    nothing_left = f.label()
    worst, t = f.slot(f.real), "%t" if m.loose else f.splat("%t")

    def watch(start: str, stop: str, bound: str) -> str:
        """In which lanes one of some states is beyond a bound."""
        f.store(f.constant(0.0), worst, f.real)
        with f.count(start, stop) as i:
            size = f.intrinsic("fabs", f.load(f.at("%z", f.scalar("mul", i, str(lanes))), f.real))
            beyond = f.compare("ugt", size, bound)
            f.store(f.select(beyond, f.constant(1.0), f.load(worst, f.real)), worst, f.real)
        return f.compare("ogt", f.load(worst, f.real), f.constant(0.0))

    def end(mask: str, when: str, start: str, stop: str) -> None:
        """Nothing is left of some states in some lanes; the first time is kept."""
        before = f.load(when, f.real)
        first = f.let(f"and {f.mask} {mask}, {f.compare('olt', t, before)}")  # infinity until then
        f.store(f.select(first, t, before), when, f.real)
        with f.count(start, stop) as i:
            place = f.at("%z", f.scalar("mul", i, str(lanes)))
            f.store(f.select(mask, f.constant(float("nan")), f.load(place, f.real)), place, f.real)

    with f.when(f.test("ne", f.word("%ctx", WORD["awaits"]), "0")):
        f.leave_if(f.let(f"xor i1 {_awaited(m, f)}, true"), nothing_left)
    lost = watch("0", str(m.system.plant_states), f.constant(1e300))
    outcome = f.let(f"zext i1 {f.any(lost)} to i64")
    if not alone:
        with f.when(f.any(lost)):
            end(lost, f.word("%ctx", WORD["lost"], "ptr"), "0", str(m.system.states))
        outcome = "0"
    blocks, diverged = f.word("%ctx", WORD["blocks"], "ptr"), f.word("%ctx", WORD["diverged"], "ptr")
    bound = f.load("%bound", f.real)
    with f.count(0, m.system.observers) as j:
        block = f.at(blocks, f.scalar("mul", j, "3"))
        start, stop, after = (f.word(block, i) for i in range(3))
        beyond = watch(start, stop, bound)
        with f.when(f.any(beyond)):
            end(beyond, f.at(diverged, f.scalar("mul", j, str(lanes))), start, after)
    f.do(f"ret i64 {outcome}")
    f.place(nothing_left)
    f.store("1", f.at("%ctx", WORD["stopped"]), "i64")
    f.do("ret i64 1")
    m.finish(f)


def _awaited(m: Module, f: Function) -> str:
    """Whether an observer that is awaited has not been masked yet, an i1."""
    awaited, diverged = f.word("%ctx", WORD["awaited"], "ptr"), f.word("%ctx", WORD["diverged"], "ptr")
    left = f.slot(f.real)
    f.store(f.constant(0.0), left, f.real)
    with f.count(0, m.system.observers) as j:
        place = f.scalar("mul", j, str(m.lanes))
        wanted, when = (f.load(f.at(array, place), f.real) for array in (awaited, diverged))
        here = f.select(f.compare("oeq", when, f.constant(float("inf"))), wanted, f.constant(0.0))
        f.store(f.add(f.load(left, f.real), here), left, f.real)
    return f.any(f.compare("ogt", f.load(left, f.real), f.constant(0.0)))
