"""Figures and claims that name what does not exist are refused before anything runs."""

from __future__ import annotations

from collections.abc import Mapping

from hgorun.config.expressions import nearest
from hgorun.config.nearest import among
from hgorun.config.refusals import Refusals
from hgorun.config.study import Figure, StudyBlocks
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath, Problem
from hgorun.result.quantities.quantities import inside, kinds, of_loops
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.windows import points_in
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.study.claimed import places_of
from hgorun.study.study import Run, Study
from hgorun.study.varied_paths import refuse_paths


def check(study: Study) -> None:
    """Refuse figures and claims that name what does not exist.

    Raises
    ------
    ConfigError
    """
    check_figures(study)
    faults = Refusals()
    for run in study.runs.values():
        with faults.of_a_part():
            for _ in run.of_values() if run.ensemble.vary is not None else ():
                pass  # what one of its values makes wrong is said before the first runs
    for i, claim in enumerate(study.claims):
        with faults.of_a_part(), study.located():
            for sentence, place in zip(study.sentences[i], places_of(i, claim), strict=True):
                for quantity in sentence.quantities:
                    _check_quantity(study, quantity, place)
    faults.refuse()


def check_figures(study: Study) -> None:
    """Refuse figures that name what does not exist.

    Raises
    ------
    ConfigError
    """
    faults = Refusals()
    runs = {}
    for run in study.runs.values():
        with faults.of_a_part():
            refuse_paths(run)
            runs[run.name] = run.experiment, run.ensemble.kind, run.one_grid
    faults.refuse()
    _check(study.figures, runs, study.source)


def check_figures_of(experiment: Experiment) -> None:
    """The same for the figures beside an experiment, in a file that has no ``runs``.

    Raises
    ------
    ConfigError
    """
    data = experiment.source.data
    if "figures" in data:
        blocks = validate(StudyBlocks, {"figures": data["figures"]}, experiment.source, ())
        _check(blocks.figures, {experiment.name: (experiment, "", True)}, experiment.source)


def _check(figures: Mapping[str, Figure], runs: Mapping[str, tuple[Experiment, str, bool]], source: Source) -> None:
    if not figures:
        return
    from hgorun.figures.names import RunNames, check

    names = {}
    for name, (experiment, kind, one_grid) in runs.items():
        model, time = experiment.plant.model, experiment.blocks.time
        span, labels = (time.start, time.end), tuple(experiment.observers)
        names[name] = RunNames(
            model.states,
            model.outputs,
            labels,
            span,
            kind,
            tuple(model.measures.values()),
            one_grid,
            model.inputs if experiment.closed else (),
        )
    faults = Refusals()
    for name, figure in figures.items():
        with faults.of_a_part(), source.located():
            check({name: figure}, names)
    faults.refuse()


def _check_quantity(study: Study, quantity: Quantity, path: KeyPath) -> None:
    for run, label in quantity.of:
        if run not in study.runs:
            alone = (
                "; of one run the name may be left out"
                if kinds()[quantity.function].of_plant and len(study.runs) == 1
                else ""
            )
            known = f"Runs: {', '.join(study.runs)}{alone}"
            raise Problem(path, f"no run is called {run!r}.{nearest(run, study.runs)} {known}")
        experiment = study.runs[run].experiment
        kind = kinds()[quantity.function]
        if label is not None and not kind.takes(label, experiment.observers):
            known = ", ".join(experiment.observers)
            raise Problem(
                path, f"run {run} has no observer {label!r}.{nearest(label, experiment.observers)} It has {known}"
            )
        if of_loops(quantity) and not experiment.closed:
            raise Problem(path, f"{quantity}: run {run} has no controller")
        model, of_input = experiment.plant.model, kind.of == "input"
        what, names = ("input", model.inputs) if of_input else ("state", model.states)
        if quantity.state is not None and quantity.state not in names:
            known = among(quantity.state, names)
            raise Problem(path, f"no {what} is called {quantity.state!r}. {what.capitalize()}s: {known}")
        _check_window(study.runs[run], quantity, path)
    if len({run for run, _ in quantity.of}) > 1 and not all(study.runs[run].single for run, _ in quantity.of):
        raise Problem(path, f"{quantity}: members of different ensembles cannot be compared")


def _check_window(run: Run, quantity: Quantity, path: KeyPath) -> None:
    """A window must have points of the run's output grid in it; a slope needs values to be drawn through."""
    window = quantity.window
    if quantity.function == "exponent":
        vary = run.ensemble.vary
        if vary is None:
            raise Problem(path, f"{quantity}: an exponent needs a run with vary, and {run.name} has none")
        if len({value for value in vary.values if value > 0 and (window is None or inside(value, window))}) < 2:
            raise Problem(path, f"{quantity}: an exponent needs at least two different values > 0 of {vary.name}")
    elif window is not None:
        time, (points, every, _) = run.experiment.blocks.time, run.experiment.grid
        since = window[0] - time.start, window[1] - time.start
        if window[0] < time.start - 1e-9 or window[1] > time.end + 1e-9:
            raise Problem(path, f"{quantity}: run {run.name} lasts from {time.start:g} to {time.end:g}")
        if not points[::every][points_in(points[::every], since)].size:
            raise Problem(path, f"{quantity}: no output point of run {run.name} lies in this window")
