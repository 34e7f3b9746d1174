"""Figures and claims that name what does not exist are refused before anything runs."""

from __future__ import annotations

from hgorun.config.expressions import nearest
from hgorun.errors import Problem
from hgorun.study.quantities import Quantity
from hgorun.study.study import Study


def check(study: Study) -> None:
    """Refuse figures and claims that name what does not exist.

    Raises
    ------
    ConfigError
    """
    with study.located():
        if study.figures:
            _check_figures(study)
        for i, sentence in enumerate(study.sentences):
            for quantity in sentence.quantities:
                _check_quantity(study, quantity, ("claims", i, "value"))


def _check_figures(study: Study) -> None:
    from hgorun.figures import RunNames, check

    names = {}
    for run in study.runs.values():
        model, time = run.experiment.plant.model, run.experiment.blocks.time
        span, labels = (time.start, time.end), tuple(run.experiment.observers)
        names[run.name] = RunNames(model.states, model.outputs, labels, span, run.ensemble.kind)
    check(study.figures, names)


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
