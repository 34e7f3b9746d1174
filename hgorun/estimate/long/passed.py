"""The stretches of a long log, carried out one after the other from where the one before has ended."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.engine.plan import Plan
from hgorun.estimate.long.long_found import Sweep
from hgorun.estimate.long.planned import Planned
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.steps.bound import beginning_of
from hgorun.symbolic.evaluate import Floats


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Passed:
    """A stretch that has been carried out.

    Attributes
    ----------
    planned : Planned
    z, w, largest
        The states, what was held and the largest sample where it began; w is None at the start of the run.
    raw : Raw
    end : ndarray
        The states at its end.
    tries : int
        Steps of all stretches so far.
    """

    planned: Planned
    z: Floats
    w: Floats | None
    largest: float
    raw: Raw
    end: Floats
    tries: int


def passed(stretches: Iterable[tuple[Planned, Plan]], sweep: Sweep) -> Iterator[Passed]:
    """All stretches; what a stretch gives is told by others, since the next one waits for its end alone.

    Parameters
    ----------
    stretches : iterable of (Planned, Plan)
    sweep : Sweep
    """
    for one, plan in stretches:
        z, w, largest = sweep.z, sweep.w, sweep.largest
        raw = carried_on(one.stretch.prepared, plan, sweep)
        del plan  # it is as large as all else
        yield Passed(planned=one, z=z, w=w, largest=largest, raw=raw, end=sweep.z, tries=sweep.tries)


def carried_on(prepared: PreparedEstimate, plan: Plan, sweep: Sweep) -> Raw:
    """The engine's arrays of a stretch, from where a sweep has come to."""
    run = prepared.run
    start = beginning_of(sweep.z, run.numbers.p, run.solver.divergence, sweep.w, sweep.largest)
    raw = prepared.program().run(plan, start)
    sweep.z, sweep.w, sweep.largest = raw.rows[-1, :, 0].copy(), raw.held.copy(), raw.largest
    sweep.diverged = np.minimum(sweep.diverged, raw.diverged[:, 0])
    sweep.tries += raw.tries
    return replace(raw, rows=raw.rows[:-1])
