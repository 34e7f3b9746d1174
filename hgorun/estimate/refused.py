"""What observers of recorded data cannot have, or lack, whether samples stand in a file or come one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.errors import Problem
from hgorun.estimate.samples import Sampled
from hgorun.observers.base import SampledObserver
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import check_limit
from hgorun.simulation.preparation.treatments import check_treatments
from hgorun.simulation.system.structure import Structure
from hgorun.symbolic.plant import PlantModel


def refuse(experiment: Experiment) -> None:
    """Refuse an experiment that cannot follow data.

    Raises
    ------
    Problem
    """
    if not experiment.observers:
        raise Problem(("observers",), "there are none: give one, for instance SHGO: {type: shgo, theta: 5, poles: -1}")
    if experiment.plant_block.discretise is not None:
        raise Problem(("plant", "discretise"), "this steps a simulated plant, and nothing is simulated here")
    for label, observer in experiment.observers.items():
        check_limit(experiment, label, observer)
    check_treatments(experiment)


def require_used(model: PlantModel, recorded: Sequence[int], structure: Structure) -> None:
    """Refuse an input that comes with the data and acts on nothing.

    Parameters
    ----------
    recorded : sequence of int
        The numbers of these inputs.

    Raises
    ------
    Problem
    """
    for number, place in enumerate(recorded):
        if not (model.depends_on_input(place) or structure.depends_on_input(number)):
            message = "nothing depends on this input, neither the plant's equations nor those of an observer"
            raise Problem(("data", "inputs", model.inputs[place]), message)


def require_apart(experiment: Experiment, samples: Sequence[Sampled]) -> None:
    """Refuse samples of a file that were taken at one time: no step leads from one of them to the other.

    Raises
    ------
    Problem
    """
    label = next((label for label, one in experiment.observers.items() if isinstance(one, SampledObserver)), None)
    for one in samples if label is not None else ():
        equal = np.flatnonzero(np.diff(one.taken) == 0)
        if equal.size:
            t = experiment.origin + one.taken[equal[0]]
            message = (
                f"{label} steps from sample to sample, and two samples were taken at {t:g}: take one of them, "
                "faults: {repeated: mean}, first or last; faults goes below data"
            )
            raise Problem(("data", "outputs", one.output), message)
