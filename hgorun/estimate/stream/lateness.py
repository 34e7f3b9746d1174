"""Whether the observers of a stream can take late samples: all of them have to, and to treat these alike."""

from __future__ import annotations

from hgorun.errors import Problem
from hgorun.observers.base import CorrectedObserver
from hgorun.observers.treatment import late_to, treatment_of, why_punctual
from hgorun.simulation.experiment.experiment import Experiment


def why_refused(experiment: Experiment) -> Problem | None:
    """Why late samples are, and what would be right: observers that treat them otherwise than others, or take none.

    Time goes back for all of them or for none. An observer that is corrected by samples has no innovation between them
    that a late one could enter, so that all go back where there is such a one.
    """
    observers = experiment.observers
    found = {label: treatment_of(observer) for label, observer in observers.items()}
    if len({*found.values()}) < 2:
        to_whom = {label: one for label, one in observers.items() if late_to(one)}
        said_of = {label: why_punctual(one, "these are late", sampled=True) for label, one in to_whom.items()}
        return next((Problem(("observers", label), why) for label, why in said_of.items() if why), None)
    jumps = any(isinstance(observer, CorrectedObserver) for observer in observers.values())
    common = "replay" if jumps else "innovation"
    others = [label for label, treatment in found.items() if treatment != common]
    said = ", ".join(f"{label}: {treatment}" for label, treatment in found.items())
    right = " and ".join(f"observers.{label}.late: {common}" for label in others)
    message = f"in a stream all observers treat late samples alike, and these do not ({said}): give {right}"
    return Problem(("observers", others[0], "late"), message)
