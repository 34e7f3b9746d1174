"""Observers that controlled steps stop at a jump of their equations, and that have not diverged for it.

Where an estimate rests on the jump of a sign, as friction holds it, every controlled step is rejected, down to the
shortest. Fixed steps cross the jump, back and forth: an observer that they follow to the end of the run is not lost.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw
from hgorun.errors import Problem, SimulationError
from hgorun.result.records.status import Verdict
from hgorun.simulation.divergence.confirmation import judged
from hgorun.simulation.passes.between_steps import SMOOTH, jumping
from hgorun.simulation.passes.passes import Pass, integrate
from hgorun.simulation.prepared import PreparedRun

_SHORTER = (1, 4, 16)  # than the nominal step
_METHOD: Method = "rk4"


def stopped(run: PreparedRun, raw: Raw, verdicts: Mapping[str, Verdict]) -> list[int]:
    """The observers for which no controlled step was small enough, and whose equations jump."""
    lost = [j for j, b in enumerate(run.observers) if b.label in verdicts and np.isfinite(raw.diverged[j, 0])]
    if not lost or run.solver.divergence is not None:
        return []
    jumps = jumping(run)
    return [j for j in lost if run.observers[j].label in jumps]


def crossed(run: PreparedRun, raw: Raw, verdicts: Mapping[str, Verdict]) -> dict[str, Verdict]:
    """What is said of observers lost with controlled steps: of those that fixed steps follow, that they are inaccurate.

    Parameters
    ----------
    raw : Raw
        What controlled steps gave.
    verdicts : mapping
        Of the observers that are not ok; where a reason is known, other than that no step was small enough, it stands.
    """
    said = dict(verdicts)
    known = not run.adaptive  # of given tolerances the reason is that no step was small enough
    unexplained = {label: v for label, v in verdicts.items() if v.status == "diverged" and not (known and v.reason)}
    left = stopped(run, raw, unexplained)
    for shorter in _SHORTER if left else ():
        step = min(run.step, run.longest_gap) / shorter
        try:
            other = integrate(run, Pass(method=_METHOD, step=step, bounded=False))
        except (Problem, SimulationError):  # the plant is lost with such steps, or there are too many of them
            continue
        for j in [j for j in left if not judged(run, other, j).lost]:
            label = run.observers[j].label
            at = run.origin + float(raw.diverged[j, 0])
            reason = (
                f"no controlled step crosses a jump of its equations at t = {at:.6g}, but steps of {step:.2g} do: "
                f"give such a step, or {SMOOTH}"
            )
            said[label] = Verdict("inaccurate", verdicts[label].at, reason)
            left.remove(j)
    return said
