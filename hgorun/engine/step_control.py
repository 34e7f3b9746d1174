"""How long a step is that an error estimate controls: for all lanes at once, or for each where they are loose."""

from __future__ import annotations

from hgorun.engine.layout import WORD
from hgorun.engine.stepper import Stepper
from hgorun.native import functions

_SAFETY, _SHRINK, GROW = 0.9, 0.2, 5.0
_SMALLEST, _SMALLEST_PART = 1e-13, 1e-30  # of |t|: below it a step changes t no more; of a segment, where t is zero
APART = 1e4  # such steps from one jump that is stepped over to the next


def block_errors(s: Stepper, errors: list[str], allowed: list[str]) -> list[str]:
    """The largest error over its tolerance of the plant and of each observer that has not diverged."""
    f = s.f
    ratios = []
    for error, tolerance in zip(errors, allowed, strict=True):
        size, zero = f.intrinsic("fabs", error), f.constant(0.0)
        ratios.append(f.select(f.compare("oeq", size, zero), zero, f.div(size, tolerance)))
    system = s.m.system
    worst = [_largest_of(s, ratios[: system.plant_states])]
    diverged = f.word("%ctx", WORD["diverged"], "ptr")
    for j, (start, _, end) in enumerate(system.blocks):
        alive = f.compare("oeq", f.load(f.at(diverged, j * f.lanes), f.real), f.constant(float("inf")))
        worst.append(_largest_of(s, [f.select(alive, r, f.constant(0.0)) for r in ratios[start:end]]))
    return worst


def _largest_of(s: Stepper, values: list[str]) -> str:
    """The largest of all values, and of all lanes that have a time in common; NaN counts as infinite."""
    f, worst = s.f, s.moment(0.0)
    apart = f.lanes > 1 and not s.m.loose
    for value in values:
        lanes = [f.let(f"extractelement {f.real} {value}, i64 {lane}") for lane in range(f.lanes)] if apart else [value]
        for one in lanes:
            one = s.chosen(s.compared("uno", one, one), float("inf"), one)
            worst = s.largest(worst, one)
    return worst


def smallest_step(s: Stepper, t: str) -> str:
    """The step from t that is too short."""
    of_segment = s.timed("fmul", s.timed("fsub", s.end, s.start), _SMALLEST_PART)
    return s.largest(s.timed("fmul", s.absolute(t), _SMALLEST), of_segment)


def fit(s: Stepper, wanted: str, longest: str, left: str) -> tuple[str, str]:
    """The step to make, and whether it lands on the end: the last two steps share what is left."""
    h = s.chosen(s.compared("olt", longest, wanted), longest, wanted)
    landing = s.compared("oge", h, s.timed("fmul", left, 1 - 1e-12))
    half = s.timed("fmul", left, 0.5)
    h = s.chosen(s.compared("ogt", h, half), half, h)
    return s.chosen(landing, left, h), landing


def factor(s: Stepper, error: str, largest: str | float) -> str:
    """How the step changes: 0.9 error^(-1/5) between 0.2 and ``largest``."""
    f = s.f
    with f.on_lanes(f.lanes if s.m.loose else 1) as block:
        power = functions.call("pow", block, error, block.constant(-1 / s.order))
    grown = s.timed("fmul", _SAFETY, power)
    grown = s.chosen(s.compared("olt", grown, largest), grown, largest)
    return s.chosen(s.compared("ogt", grown, _SHRINK), grown, _SHRINK)
