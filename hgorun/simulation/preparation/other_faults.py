"""What else is wrong with a run that cannot be prepared: with its grid, its plant, its measurement, its observers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from hgorun.config.refusals import of_other_blocks
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.timeline.grid import even_grid_of


@contextmanager
def told_together(experiment: Experiment, *more: Callable[[], object]) -> Iterator[None]:
    """Turn what is wrong with a run into an error whose ``others`` are faults of other blocks.

    Parameters
    ----------
    experiment : Experiment
    *more : callable
        Checks beside those of its plant, its measurement and its observers.
    """
    try:
        with experiment.located():
            yield
    except ConfigError as first:
        told = (first, *first.others)
        first.add_others(of_other_blocks(told, _checks(experiment, more)))
        raise


def check_parts(experiment: Experiment) -> None:
    """Refuse what is wrong with the parts of a run, each whatever else is.

    Raises
    ------
    ConfigError
        The first fault, with those of other blocks.
    """
    for first in (found := of_other_blocks((), _checks(experiment, (partial(check_grid, experiment),)))):
        first.add_others(found)
        raise first


def check_grid(experiment: Experiment) -> None:
    """Refuse windows outside of the run and grids that do not fit together, whatever the plant is.

    Raises
    ------
    ConfigError
    """
    with experiment.located():
        even_grid_of(experiment.blocks.time, experiment.blocks.metrics, 0, 0)


def _checks(experiment: Experiment, more: tuple[Callable[[], object], ...]) -> Iterator[Callable[[], object]]:
    yield from more
    yield lambda: experiment.plant
    try:
        _ = experiment.plant
    except ConfigError:
        return  # what is made of it does not exist
    yield lambda: experiment.stretches
    for label in experiment.observers:
        yield partial(_check_observer, experiment, label)


def _check_observer(experiment: Experiment, label: str) -> None:
    """Refuse what does not fit the plant, or the observer's own states."""
    design = experiment.design_alone(label)
    with experiment.located():
        design.check_own()
