"""Data of panels of ensembles: what members have measured, beside what theory predicts, and their trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial

import numpy as np

from hgorun.analysis.noise.deviation import deviation_in_window
from hgorun.analysis.noise.prediction import has_noise, without_noise
from hgorun.analysis.reasons import NoValue, Outcome, outcome
from hgorun.ensemble.collected.collected import Collected, Floats
from hgorun.ensemble.statistics.statistics import quantiles
from hgorun.figures.followed import MembersData
from hgorun.figures.scaling import ScaledObserver, ScalingData
from hgorun.observers.capabilities import FilterOrder
from hgorun.result.metrics.base import all_metrics, unit_of
from hgorun.result.quantities.quantities import measure_quantity
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared
from hgorun.study.measured import Numbers
from hgorun.study.study import Run, Study

_OF_THE_WINDOW = ("std", "mean", "amplitude")  # quantities of the steady window that are not metrics


def scaling_data(study: Study, figure: str, ensembles: Mapping[str, Numbers]) -> dict[int, ScalingData]:
    """{number of the panel: what it shows}, for the scaling panels of a figure.

    Parameters
    ----------
    ensembles : mapping of str to Numbers
        For every run of the study what its members have measured.
    """
    scaled = study.scaled(figure)
    panels = {i: study.figures[figure].panels[i].scaling for i in scaled}
    asked: dict[str, list[Quantity]] = {}
    for i, (name, quantities) in scaled.items():
        panel = panels[i]
        if panel is not None and panel.theory:
            asked.setdefault(name, []).extend(quantities)
    predicted = {name: predictions(study.runs[name], quantities) for name, quantities in asked.items()}
    found = {}
    for i, (name, quantities) in scaled.items():
        run, panel = study.runs[name], panels[i]
        assert panel is not None
        assert run.ensemble.vary is not None
        observers = {}
        for q in quantities:
            block = run.experiment.observers[str(q.of[0][1])]
            theory = predicted[name][q] if panel.theory else []
            observers[str(q.of[0][1])] = ScaledObserver(
                block.type,
                block.r if isinstance(block, FilterOrder) else None,
                _median(ensembles[name][str(q)]),
                _line(theory),
                tuple(dict.fromkeys(one.reason for one in theory if one.reason is not None)),
                ensembles[name][str(q)] if run.ensemble.seeds is not None else None,
            )
        units = {"time": run.experiment.blocks.time.unit, **run.experiment.plant.units}
        of_error = panel.of in _OF_THE_WINDOW
        unit = units.get(panel.state, "") if of_error else unit_of(panel.of, panel.state, units)
        found[i] = ScalingData(name, panel.state, run.ensemble.vary.name, np.array(run.values), observers, unit)
    return found


def members_data(run: Run, members: Collected) -> MembersData:
    """What a panel of the trajectories of a run's members shows."""
    vary = run.ensemble.vary
    values = np.repeat(np.array(run.values), run.shape[1]) if vary is not None else np.zeros(len(members))
    return MembersData(run.name, run.ensemble.kind, members, vary.name if vary is not None else "", values)


def _median(values: Floats) -> Floats:
    """Over seeds, of which those without a number count as infinite; shape (values,)."""
    (median,) = quantiles(values.T, ~np.isnan(values.T), (0.5,))
    return median


def refused(scalings: Mapping[int, ScalingData]) -> list[str]:
    """Which lines of theory are missing, at all or in part, and why: a sentence each."""
    found = []
    for data in scalings.values():
        for label, observer in data.observers.items():
            what = "no line of theory" if observer.theory is None else "gaps in the line of theory"
            found += [f"{what} for {label}, {data.state}: {reason}" for reason in observer.reasons]
    return found


def _line(theory: Sequence[Outcome[float]]) -> np.ndarray | None:
    """What is predicted, NaN where it is not; None where nothing is."""
    values = np.array([np.nan if one.reason is not None else one.value for one in theory])
    return values if np.any(np.isfinite(values)) else None


def predictions(run: Run, quantities: Sequence[Quantity]) -> dict[Quantity, list[Outcome[float]]]:
    """For every value of an ensemble what the linearised observers would measure, or why it cannot be told."""
    found: dict[Quantity, list[Outcome[float]]] = {q: [] for q in quantities}
    for experiment in run.of_values():
        member = _Member(experiment)
        for q, values in found.items():
            values.append(outcome(partial(member.predicted, q)))
    return found


class _Member:
    """One member of an ensemble: its noise-free runs, and what the noise does to them."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self._on_grid = cache(partial(_OnGrid, experiment))

    def predicted(self, quantity: Quantity) -> float:
        """A quantity of the steady window, measured on the error without noise and what the noise adds to it.

        Raises
        ------
        NoValue
        """
        if self.experiment.closed:
            raise NoValue("what theory says of noise is of an observer beside a plant, not of one that drives it")
        metric = all_metrics().get(quantity.function)
        if quantity.function not in _OF_THE_WINDOW and (metric is None or metric.window != "steady"):
            raise NoValue(f"the theory of noise is of the steady window, {quantity.function} is not")
        step = self.experiment.blocks.time.output_step if metric is None else self.experiment.metric_step
        (run, label), *_ = quantity.of
        return measure_quantity(quantity, {run: self._on_grid(step).predicted(str(label))})


class _OnGrid:
    """A member on an output grid, each of its runs made where it is needed."""

    def __init__(self, experiment: Experiment, step: float) -> None:
        if step != experiment.blocks.time.output_step:
            experiment = experiment.varied({"time.output_step": step, "metrics.record": None})
        self.run = prepare(experiment)
        self._noisy = cache(partial(simulate_prepared, self.run))
        self._estimate = cache(self._outcome)

    @cached_property
    def noise_free(self) -> Result:
        """The run without noise.

        Raises
        ------
        NoValue
            When there is no noise.
        """
        if not has_noise(self.run):
            raise NoValue("the measurement has no noise")
        return simulate(without_noise(self.run.experiment))

    def predicted(self, label: str) -> Result:
        """The run without noise, with what the linearised observer adds to its estimate in the steady window."""
        noise_free = self.noise_free
        observer = replace(noise_free.observers[label], xhat=self._estimate(label).value, metrics={})
        return replace(noise_free, observers={label: observer})

    def _outcome(self, label: str) -> Outcome[np.ndarray]:
        return outcome(partial(self._with_noise, label))

    def _with_noise(self, label: str) -> np.ndarray:
        inside, deviation = deviation_in_window(self.run, label, self.noise_free, self._noisy)
        xhat = self.noise_free.observers[label].xhat.copy()
        xhat[inside] += deviation
        return xhat
