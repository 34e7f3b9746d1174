"""The numbers of a stream at its start, of whose inputs some may not be known yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.design.first_inputs import Recorded
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import numbers_of
from hgorun.simulation.prepared import Numbers
from hgorun.simulation.system.structure import Structure


@dataclass(frozen=True, eq=False, repr=False)
class Begun:
    """What is known at the start of a stream."""

    plant: BuiltPlant
    time: Time
    structure: Structure
    numbers: Numbers
    recorded: Recorded = ()


def numbers_at_start(
    experiment: Experiment,
    structure: Structure,
    recorded: Sequence[int],
    told: Mapping[int, float],
    driven: Sequence[str],
) -> Numbers:
    """The numbers at the start, inputs that are not known yet at zero; or at NaN where zero does not do."""

    def with_others_at(value: float) -> Numbers:
        lines = tuple((place, told.get(number, value), 0.0) for number, place in enumerate(recorded))
        return numbers_of(structure, experiment.plant, experiment, list(experiment.designs.values()), lines)

    try:
        return with_others_at(0.0)
    except Problem:
        if not driven or len(told) == len(recorded):
            raise
        return with_others_at(np.nan)
