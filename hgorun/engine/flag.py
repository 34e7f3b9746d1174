"""The native function that looks for divergence."""

from __future__ import annotations

from hgorun.engine.layout import WORD
from hgorun.engine.module import Module


def add_flag(m: Module, *, alone: bool) -> None:
    """``flag(ctx, t, z, bound)``: mask the observers that have left the bound; 1 when the plant has.

    A plant that is not ``alone`` does not end the run of the others: all its lane becomes NaN, and when that was is
    kept in ``lost``.
    """
    lanes = m.lanes
    arguments = f"ptr %ctx, {m.time} %t, ptr %z, ptr %bound"
    f = m.function("flag", arguments, returns="i64", attributes="nounwind noinline")
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
    m.finish(f)
