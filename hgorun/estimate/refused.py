"""What observers of recorded data cannot have, or lack: the same whether samples stand in a file or come one by one."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.errors import Problem
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.preparation import check_limit
from hgorun.simulation.structure import Structure
from hgorun.simulation.treatments import check_treatments
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
