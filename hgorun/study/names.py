"""The names that the figures of a study may use, known before anything runs."""

from __future__ import annotations

from hgorun.study.study import Study


def check_figures(study: Study) -> None:
    """Refuse figures that name what does not exist.

    Raises
    ------
    Problem
    """
    from hgorun.figures import check

    experiments = {name: run.experiment for name, run in study.runs.items()}
    labels = [label for e in experiments.values() for label in e.observers]
    labels += [f"{name}/{label}" for name, e in experiments.items() for label in e.observers]
    models = [e.plant.model for e in experiments.values()]
    times = [e.blocks.time for e in experiments.values()]
    check(
        study.figures,
        tuple(dict.fromkeys(s for m in models for s in m.states)),
        tuple(dict.fromkeys(s for m in models for s in m.outputs)),
        tuple(dict.fromkeys(labels)),
        (min(t.start for t in times), max(t.end for t in times)),
    )
