"""Figures and claims that name what does not exist are refused before anything runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from hgorun.config.expressions import nearest
from hgorun.config.models import Figure, StudyBlocks
from hgorun.config.validation import validate
from hgorun.errors import Problem
from hgorun.simulation.experiment import Experiment
from hgorun.study.quantities import Quantity
from hgorun.study.study import Study


def check(study: Study) -> None:
    """Refuse figures and claims that name what does not exist.

    Raises
    ------
    ConfigError
    """
    check_figures(study)
    with study.located():
        for i, sentence in enumerate(study.sentences):
            for quantity in sentence.quantities:
                _check_quantity(study, quantity, ("claims", i, "value"))


def check_figures(study: Study) -> None:
    """Refuse figures that name what does not exist.

    Raises
    ------
    ConfigError
    """
    with study.located():
        _check(study.figures, {run.name: (run.experiment, run.ensemble.kind) for run in study.runs.values()})


def check_figures_of(experiment: Experiment) -> None:
    """The same for the figures beside an experiment, in a file that has no ``runs``.

    Raises
    ------
    ConfigError
    """
    data = experiment.source.data
    if "figures" in data:
        blocks = validate(StudyBlocks, {"figures": data["figures"]}, experiment.source, ())
        with experiment.located():
            _check(blocks.figures, {experiment.name: (experiment, None)})


def _check(
    figures: Mapping[str, Figure], runs: Mapping[str, tuple[Experiment, Literal["seeds", "vary"] | None]]
) -> None:
    if not figures:
        return
    from hgorun.figures.names import RunNames, check

    names = {}
    for name, (experiment, kind) in runs.items():
        model, time = experiment.plant.model, experiment.blocks.time
        span, labels = (time.start, time.end), tuple(experiment.observers)
        names[name] = RunNames(model.states, model.outputs, labels, span, kind)
    check(figures, names)


def _check_quantity(study: Study, quantity: Quantity, path: tuple[str | int, ...]) -> None:
    for run, label in quantity.of:
        if run not in study.runs:
            raise Problem(path, f"no run is called {run!r}.{nearest(run, study.runs)} Runs: {', '.join(study.runs)}")
        experiment = study.runs[run].experiment
        if label is not None and label not in experiment.observers:
            known = ", ".join(experiment.observers)
            raise Problem(
                path, f"run {run} has no observer {label!r}.{nearest(label, experiment.observers)} It has {known}"
            )
        states = experiment.plant.model.states
        if quantity.state is not None and quantity.state not in states:
            raise Problem(path, f"no state is called {quantity.state!r}. States: {', '.join(states)}")
    if len({run for run, _ in quantity.of}) > 1 and not all(study.runs[run].single for run, _ in quantity.of):
        raise Problem(path, f"{quantity}: members of different ensembles cannot be compared")
