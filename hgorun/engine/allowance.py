"""How large an error a step may have: for every state, in its own unit.

With an absolute tolerance given, |error| <= atol + rtol max(|z|, |z_new|). Without one,

    |error| <= rtol max(|z|, |z_new|, 1e-6 (the largest |z| so far)) + rounding

where the rounding is that of the terms which z' is the sum of: an error of its size is not made smaller by a shorter
step. A state that has been zero so far and rises like a power of t has a relative error that does not depend on
the step; there a very short first step is made whatever the error. Such a state may be too small for double precision
at first, like t^40 where t = 1e-10, and its digits are lost where numbers become subnormal: errors below 1e-301 are
allowed to all states. Everything else scales with each state's unit: powers of two change no bit.
"""

from __future__ import annotations

from hgorun.engine.layout import WORD, Held
from hgorun.engine.stepper import Stepper

_TINY = 2.0**-1000  # below it digits are lost
SMALL = 1e-6  # of the largest |z| so far: what a state has to be known to when it is smaller
_NUDGE = 2.0**-26  # relative changes of z and w that show the size of the terms in z'
# of a segment, and of t: below the time scale of what is resolved there, and above that at which states which are
# zero but for rounding begin to rise
_SHORT, _SHORTEST = 1e-11, 1e-12


def tolerances(s: Stepper) -> list[str]:
    """What is allowed for every state, but for rounding."""
    f = s.f
    rtol, atol, small = (f.splat(f.word("%ctx", WORD[name], "double")) for name in ("rtol", "atol", "small"))
    sizes = f.word("%ctx", WORD["size"], "ptr")
    atol = f.add(atol, f.constant(_TINY))
    found = []
    for i in range(s.size):
        scale = f.mul(small, f.load(f.at(sizes, i * f.lanes), f.real))
        for array in (s.before, s.z):
            one = f.intrinsic("fabs", f.load(f.at(array, i * f.lanes), f.real))
            scale = f.select(f.compare("ogt", one, scale), one, scale)
        found.append(f.add(atol, f.mul(rtol, scale)))
    return found


def note_sizes(s: Stepper, where: str = "") -> None:
    """Keep the largest |z| of every state; ``where``: in some lanes."""
    f = s.f
    sizes = f.word("%ctx", WORD["size"], "ptr")
    for i in range(s.size):
        place = f.at(sizes, i * f.lanes)
        old, new = f.load(place, f.real), f.intrinsic("fabs", f.load(f.at(s.z, i * f.lanes), f.real))
        larger = f.compare("ogt", new, old)
        if where:
            larger = f.let(f"and {f.mask} {larger}, {where}")
        f.store(f.select(larger, new, old), place, f.real)


def rounding(s: Stepper, h: str, errors: list[str]) -> list[str]:
    """What is allowed besides where no absolute tolerance is given."""
    f, zero = s.f, s.f.constant(0.0)
    change = _change(s)
    waived = s.spread(_waived(s, h))
    sizes = f.word("%ctx", WORD["size"], "ptr")
    found = []
    for i, (error, one) in enumerate(zip(errors, s.step_of(change, h), strict=True)):
        noise = f.mul(f.constant(s.roundings * 2.0**-52 / _NUDGE), f.intrinsic("fabs", one))
        noise = f.select(f.compare("ord", noise, noise), noise, zero)
        new = f.compare("oeq", f.load(f.at(sizes, i * f.lanes), f.real), zero)
        missed = f.intrinsic("fabs", error)
        free = f.select(f.compare("olt", missed, waived), missed, zero)  # finite, and waived
        found.append(f.add(noise, f.select(new, free, zero)))
    return found


def _waived(s: Stepper, h: str) -> str:
    """Errors below it are allowed to states that have been zero: infinity for a very short step, 0 for others."""
    limits = s.timed("fmul", s.timed("fsub", s.end, s.start), _SHORT), s.timed("fmul", s.absolute(s.start), _SHORTEST)
    short = s.either(*(s.compared("ole", h, limit) for limit in limits))
    return s.chosen(short, float("inf"), 0.0)


def _change(s: Stepper) -> str:
    """How z' at the end of the step changes with every state and every held value, each a little and differently.

    A function of its own: it is rarely called, and would be compiled with the loop otherwise.
    """
    f, target = s.f, s.array()
    name = f"change{s.regime}"
    _add_change(s, name)
    f.call(name, f"ptr {s.p}, ptr {s.c}, ptr {s.clock[1.0]}, ptr {s.z}, ptr {s.slope}, ptr {s.w}, ptr {target}")
    return target


def _add_change(s: Stepper, name: str) -> None:
    """``change<i>(p, c, tau, z, slope, w, target)``."""
    m = s.m
    pointers = ", ".join(f"ptr %{one}" for one in ("p", "c", "tau", "z", "slope", "w", "target"))
    f = m.function(name, pointers, attributes="nounwind noinline")
    lanes, held = f.lanes, m.system.held
    z, w = (f.slot("double", size * lanes) for size in (s.size, held.size))
    starts = [0] * m.system.plant_states
    starts += [start for start, _, end in m.system.blocks for _ in range(start, end)]
    starts += [0] * (s.size - len(starts))
    for i, start in enumerate(starts):  # what is measured and what it is compared with change in opposite ways
        nudge = (1 + (i - start) / (1 + s.size)) * (_NUDGE if start == 0 else -_NUDGE)
        f.store(f.mul(f.load(f.at("%z", i * lanes), f.real), f.constant(1 + nudge)), f.at(z, i * lanes), f.real)
    for k in range(held.size):
        nudge = -_NUDGE if k < held.outputs * held.width and k % held.width >= Held.S else _NUDGE
        f.store(f.mul(f.load(f.at("%w", k * lanes), f.real), f.constant(1 + nudge)), f.at(w, k * lanes), f.real)
    s.flow.main(f, "%p", "%c", "%tau", z, w, "%target")
    for i in range(s.size):
        place = f.at("%target", i * lanes)
        f.store(f.sub(f.load(place, f.real), f.load(f.at("%slope", i * lanes), f.real)), place, f.real)
    f.do("ret void")
    m.finish(f)
