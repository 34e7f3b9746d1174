"""The names that the figures of a study may use, known before anything runs."""

from __future__ import annotations

from hgorun.study.study import Study


def check_figures(study: Study) -> None:
    """Refuse figures that name what does not exist.

    Raises
    ------
    Problem
    """
    from hgorun.figures import RunNames, check

    names = {}
    for run in study.runs.values():
        model, time = run.experiment.plant.model, run.experiment.blocks.time
        span, labels = (time.start, time.end), tuple(run.experiment.observers)
        names[run.name] = RunNames(model.states, model.outputs, labels, span, run.ensemble.kind)
    check(study.figures, names)
