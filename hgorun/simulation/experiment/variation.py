"""What of an experiment no longer holds when some of its blocks are others."""

from __future__ import annotations

from hgorun.simulation.experiment.blocks import Checked

_OF_FORMS = {"_forms", "forms", "coordinates"}  # what follows from the forms of the plant


def unchanged(before: Checked, now: Checked) -> set[str]:
    """The labels of the observers whose blocks are the same objects."""
    return {label for label, observer in now.observers.items() if observer is before.observers.get(label)}


def stale(before: Checked, now: Checked) -> set[str]:
    """The names of what an :class:`~hgorun.Experiment` has derived from parts that have changed.

    Blocks that nobody touched are the same objects, see :func:`~hgorun.simulation.experiment.blocks.check_again`.
    """
    found = {"designs"}
    time = now.blocks.time is not before.blocks.time
    plant = now.plant is not before.plant or now.blocks.controller is not before.blocks.controller
    if plant or (time and now.blocks.time.start != before.blocks.time.start):
        found |= {"plant", "_formed", *_OF_FORMS, "stretches", "_by_availability", "grid"}
    if now.observers is not before.observers:
        found |= {"_by_availability"}
        found |= _OF_FORMS if now.observers.keys() == before.observers.keys() else {*_OF_FORMS, "grid"}
    if now.measurement is not before.measurement or time:
        found |= {"stretches", "_by_availability"}
    if time or now.blocks.metrics is not before.blocks.metrics:
        found |= {"grid"}
    return found
