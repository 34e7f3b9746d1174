"""Branches of an observability map: states that give the same outputs and derivatives, between which J is singular."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.subject import Subject
from hgorun.result.windows import points_in
from hgorun.simulation.divergence.why_diverged import determinants


def on_another_branch(subject: Subject) -> bool:
    """Whether the estimate is where the determinant of J has the other sign than at the truth, all the steady window.

    The observer cannot tell the two: its correction vanishes there as it does at the truth, whatever its gain.
    """
    along = determinants(subject.run, subject.block)
    if along is None:
        return False
    start, end = subject.result.windows["steady"]
    steady = points_in(subject.result.time, (float(start), float(end)))
    truth, estimate = subject.result.truth_of(subject.label)[steady], subject.found.xhat[steady]
    if not len(truth) or truth.shape[1] != subject.block.form.plant.n or not np.all(np.isfinite(estimate)):
        return False
    return bool(np.all(np.sign(along(truth)) == -np.sign(along(estimate))))
