"""Everything that theory says of an experiment's observers, beside what its simulation shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.analysis.convergence.contributor import promises
from hgorun.analysis.findings import Context, Contributor, Findings
from hgorun.analysis.noise.contributor import noise
from hgorun.analysis.papers.contributor import conditions
from hgorun.analysis.stability.contributor import excitations, limits
from hgorun.errors import SimulationError
from hgorun.files import json_value
from hgorun.result.result import Result
from hgorun.result.theory import Transient
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import perform, prepare

# each adds what it knows; a later one's value wins over an earlier one's
CONTRIBUTORS: tuple[Contributor, ...] = (promises, limits, noise, excitations, conditions)

# that every observer has in JSON, null where there is no value
KEYS = (
    "poles",
    "hurwitz",
    "beta",
    "chi",
    "lipschitz",
    "theta_bound",
    "theta_critical",
    "delay_bound",
    "delay_critical",
    "period_critical",
    "tau_bound",
    "noise_rms_predicted",
    "noise_rms_measured",
    "excitation",
)

_ABSENT = {
    "theta_critical": "found by simulating again and again: asked for with --search",
    "tau_bound": "theorem 2.4.1 is for fhgo1",
}


@dataclass(frozen=True)
class Analysis:
    """What is known of every observer.

    Attributes
    ----------
    name : str
    observers : mapping of str to Findings
    result : Result
        The simulation.
    """

    name: str
    observers: Mapping[str, Findings]
    result: Result

    @property
    def transients(self) -> dict[str, Transient]:
        """Errors and their bounds over time, of the observers that have some."""
        return {label: f.transient for label, f in self.observers.items() if f.transient is not None}

    def predicted(self) -> dict[str, dict[str, float]]:
        """The numbers that stand beside metrics in a comparison: {label: {column: number}}."""
        return {label: _predicted(found) for label, found in self.observers.items()}

    def as_json(self, file: str | None = None) -> dict[str, Any]:
        """``{"name", "file", "observers": {label: {key: value, "reasons": {key: text}, "remarks": [text]}}}``.

        Complex numbers are [re, im]; numbers that are not finite are text.
        """
        observers = {}
        for label, found in self.observers.items():
            values = {key: json_value(value) for key, value in found.values.items()}
            observers[label] = values | {"reasons": dict(found.reasons), "remarks": list(found.remarks)}
        return {"name": self.name, "file": file, "observers": observers}


def analyze(experiment: Experiment, contributors: Sequence[Contributor] = CONTRIBUTORS) -> Analysis:
    """Simulate an experiment and say what theory promises for it.

    Parameters
    ----------
    experiment : Experiment
    contributors : sequence of Contributor

    Raises
    ------
    ConfigError
        When the configuration does not fit together.
    SimulationError
        When the plant diverges.
    """
    run = prepare(experiment)
    return analysis_of(run, perform(run), contributors)


def analysis_of(run: PreparedRun, result: Result, contributors: Sequence[Contributor] = CONTRIBUTORS) -> Analysis:
    """The same with a run that has been carried out."""
    context = Context(run, result)
    gathered = {label: Findings() for label in result.observers}
    with run.experiment.located():
        for contributor in contributors:
            try:
                contributed = contributor(context)
            except (np.linalg.LinAlgError, SimulationError) as reason:
                for own in gathered.values():
                    own.remarks.append(f"{contributor.__name__}: {reason}")
            else:
                for label, found in contributed.items():
                    gathered[label].add(found)
    for found in gathered.values():
        for key in KEYS:
            if key not in found.values:
                found.withhold(_ABSENT.get(key, "not computed for this observer"), key)
        found.values = {key: found.values[key] for key in dict.fromkeys([*KEYS, *found.values])}
    return Analysis(run.experiment.name, gathered, result)


def _predicted(found: Findings) -> dict[str, float]:
    values = found.values
    columns: dict[str, Any] = {}
    if values.get("beta") is not None and values.get("theta") is not None:
        columns["beta theta"] = values["beta"] * values["theta"]
    for key in ("delay_bound", "delay_critical", "period_critical"):
        columns[key] = values.get(key)
    for state, value in (values.get("noise_rms_predicted") or {}).items():
        columns[f"noise_rms_predicted {state}"] = value
    return {key: float(value) for key, value in columns.items() if value is not None}
