"""Whether an estimate takes shorter steps where its own lose an observer: a file and a stream follow one rule."""

from __future__ import annotations

from hgorun.engine.again import Again
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.system.structure import Structure


def again_of(experiment: Experiment, structure: Structure) -> Again | None:
    """Which observers a flow has lost; None where a given step, or a given bound, is meant as it is."""
    if experiment.given_step is not None or experiment.blocks.solver.divergence is not None:
        return None
    return Again.of(structure.system)
