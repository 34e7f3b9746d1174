"""Data of scaling panels: what the members of an ensemble have measured, beside what theory predicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.linear.transfer import response
from hgorun.figures.scaling import ScaledObserver, ScalingData
from hgorun.observers.capabilities import FilterOrder
from hgorun.simulation.simulate import prepare
from hgorun.study.study import Run, Study


def scaling_data(
    study: Study, figure: str, ensembles: Mapping[str, Sequence[Mapping[str, float]]]
) -> dict[int, ScalingData]:
    """{number of the panel: what it shows}, for the scaling panels of a figure.

    Parameters
    ----------
    ensembles : mapping of str to sequence of mapping
        For every run of the study what its members have measured, {text of a quantity: value}.
    """
    found, predicted = {}, {}
    for i, (name, quantities) in study.scaled(figure).items():
        run, members = study.runs[name], ensembles[name]
        scaling = study.figures[figure].panels[i].scaling
        assert scaling is not None
        assert run.ensemble.vary is not None
        if scaling.theory and name not in predicted:
            predicted[name] = _predicted(run)
        state = run.experiment.plant.model.states.index(scaling.state)
        observers = {}
        for q in quantities:
            label = str(q.of[0][1])
            block = run.experiment.observers[label]
            observers[label] = ScaledObserver(
                block.type,
                block.r if isinstance(block, FilterOrder) else None,
                np.array([member[str(q)] for member in members]),
                predicted[name][label][:, state] if scaling.theory else None,
            )
        unit = run.experiment.plant.units.get(scaling.state, "")
        found[i] = ScalingData(name, scaling.state, run.ensemble.vary.name, np.array(run.varied), observers, unit)
    return found


def _predicted(run: Run) -> dict[str, np.ndarray]:
    """Steady amplitudes (members, n) of every observer's error, linearised where the plant starts.

    The response to a sum of sinusoids reaches the sum of their amplitudes.
    """
    found: dict[str, list[np.ndarray]] = {}
    for experiment in run.members():
        prepared = prepare(experiment)
        spectra = [item.spectrum() for item in experiment.measurement.noise or ()]
        waves = [wave for spectrum in spectra if spectrum is not None for wave in spectrum.waves]
        for label in experiment.observers:
            at = Linearisation(prepared, label)
            linear = at.at(experiment.blocks.time.start, at.at_rest(experiment.plant.initial))
            gains = np.abs(response(linear, np.array([w.omega for w in waves])))
            sizes = np.abs([w.phasor for w in waves])
            found.setdefault(label, []).append(np.tensordot(sizes, gains, axes=1).max(axis=1))
    return {label: np.array(values) for label, values in found.items()}
