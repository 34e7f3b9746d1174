"""What observers do with late samples, and their groups by it."""

from __future__ import annotations

from collections.abc import Mapping

from hgorun.errors import Problem
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import Treatment, are_late
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.recalling import RecallingObserver
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.design.design import Design
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.scheduling import lags_of


def treatments_of(experiment: Experiment, channels: list[Channel]) -> tuple[Treatment, ...]:
    """What observers do with late samples beside the common innovation; nothing where no sample is late.

    In a closed loop what each of them does, one after the other: each drives a plant of its own.

    Raises
    ------
    Problem
        Where an observer cannot do what it is asked to.
    """
    check_treatments(experiment)
    found = {label: treatment_of(observer) for label, observer in experiment.observers.items()}
    late = are_late(channels)
    for label, treatment in found.items():
        observer = experiment.observers[label]
        continuous = [c for c in channels if any(s.continuous for s in c.stretches)]
        delayed = late or any(not s.undelayed for c in continuous for s in c.stretches)
        if treatment != "innovation" and observer.late is not None and continuous and delayed:
            message = f"{treatment} needs sampled outputs, but {continuous[0].name} is continuous"
            raise Problem(("observers", label, "late"), message)
    if experiment.closed:
        return _in_loops(experiment, found if late else dict.fromkeys(found, "innovation"))
    own_past = [label for label, lags in lags_of(experiment).items() if lags.size]
    if late and own_past and "replay" in found.values():
        other = next(label for label, treatment in found.items() if treatment == "replay")
        message = f"it looks back at its own past, and {other} goes back in time (late: replay): run them apart"
        raise Problem(("observers", own_past[0], "type"), message)
    known: tuple[Treatment, ...] = ("received", "drop", "replay")
    return tuple(treatment for treatment in known if late and treatment in found.values())


def check_treatments(experiment: Experiment) -> None:
    """Refuse what an observer cannot do with late samples, whether any come or not.

    Raises
    ------
    Problem
    """
    for label, observer in experiment.observers.items():
        if isinstance(observer, RecallingObserver) and observer.late is not None:
            raise Problem(("observers", label, "late"), "this observer crosses the delay itself: leave the key out")
        if isinstance(observer, SampledObserver) and observer.late not in (None, "drop"):
            message = "this observer takes samples without delay: it can leave late ones out (late: drop)"
            raise Problem(("observers", label, "late"), message)
        if observer.late == "innovation" and isinstance(observer, CorrectedObserver):
            message = f"{observer.type} is corrected by samples and has no innovation between them: replay or drop"
            raise Problem(("observers", label, "late"), message)


def _in_loops(experiment: Experiment, found: Mapping[str, Treatment]) -> tuple[Treatment, ...]:
    for label, treatment in found.items():
        if isinstance(experiment.observers[label], RecallingObserver):
            message = "its copies live in the past and need the inputs of then, which a controller does not keep"
            raise Problem(("observers", label, "type"), message)
        if treatment == "replay":
            raise Problem(
                ("observers", label, "late"),
                "replay takes an observer back to the time of a late sample, but not the plant, which its estimates "
                "have driven since then: innovation or drop",
            )
    return tuple(found.values())


def in_groups(experiment: Experiment, treatments: tuple[Treatment, ...]) -> list[list[Design]]:
    """The designs by what their observers do with late samples: the common innovation first."""
    designs = experiment.designs
    if experiment.closed:
        return [[], *([design] for design in designs.values())]
    if not treatments:
        return [list(designs.values())]
    of = {label: treatment_of(observer) for label, observer in experiment.observers.items()}
    return [[d for label, d in designs.items() if of[label] == one] for one in ("innovation", *treatments)]
