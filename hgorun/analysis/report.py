"""Everything that theory says of an experiment's observers, beside what its simulation shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hgorun.analysis.convergence.theorem import transient_of
from hgorun.analysis.finding import FINDINGS, Finding, Remarked, Value, all_findings
from hgorun.analysis.reasons import NoValue, outcomes
from hgorun.analysis.subject import Context, Subject
from hgorun.config.named import Named, name_keys
from hgorun.config.nearest import listed, nearest
from hgorun.config.types import describe
from hgorun.errors import ConfigError, PluginError, called
from hgorun.files import json_value
from hgorun.result.records.theory import Transient
from hgorun.result.result import Result
from hgorun.simulation.experiment.expected import require_experiment
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.outcome.outcome import since_start
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared


@dataclass(frozen=True)
class Findings:
    """What is known of one observer, and why the rest is not.

    Attributes
    ----------
    values : mapping of str to Value or None
        By the findings' names; None where there is a reason.
    reasons : mapping of str to str
        Why a finding has no value.
    remarks : tuple of str
    """

    values: Mapping[str, Value | None]
    reasons: Mapping[str, str]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        name_keys(self, values="finding", reasons="finding without a value")


@dataclass(frozen=True)
class Analysis:
    """What is known of every observer.

    Attributes
    ----------
    name : str
    findings : tuple of Finding
        What was asked for.
    observers : mapping of str to Findings
    result : Result
        The simulation.
    context : Context
        The run and the same simulation, its time counted from its start.
    """

    name: str
    findings: tuple[Finding, ...]
    observers: Mapping[str, Findings]
    result: Result
    context: Context

    def __post_init__(self) -> None:
        name_keys(self, observers="observer")

    @cached_property
    def transients(self) -> dict[str, Transient]:
        """Errors and their bounds over time, of the observers that have some."""
        subjects = self.context.subjects
        return outcomes(subjects, lambda label: transient_of(subjects[label]))[0]

    def predicted(self) -> dict[str, dict[str, float]]:
        """The numbers that stand beside metrics in a comparison: {label: {column: number}}."""
        return Named({label: self._predicted(found) for label, found in self.observers.items()}, "observer")

    def _predicted(self, found: Findings) -> dict[str, float]:
        columns: dict[str, float] = {}
        for finding in self.findings:
            value = found.values.get(finding.name) if "compare" in finding.places else None
            if isinstance(value, Mapping):
                columns |= {f"{finding.title} {state}": float(number) for state, number in value.items()}
            elif isinstance(value, (int, float)):
                columns[finding.title] = float(value)
        return columns

    def as_json(self, file: str | None = None) -> dict[str, Any]:
        """``{"name", "file", "units", "observers": {label: {key: value, "reasons": {key: text}, "remarks": [text]}}}``;
        an observer with constant gain has ``"coordinates": {"map", "chains": {output: length}}`` besides.

        Complex numbers are [re, im]; numbers that are not finite are text.
        """
        shown = {finding.name for finding in self.findings if "json" in finding.places}
        observers = {}
        for label, found in self.observers.items():
            values = {key: json_value(value) for key, value in found.values.items() if key in shown}
            reasons = {key: reason for key, reason in found.reasons.items() if key in shown}
            observers[label] = values | {"reasons": reasons, "remarks": list(found.remarks)}
            taken = self.result.observers[label].coordinates
            if taken is not None:
                observers[label]["coordinates"] = {"map": taken.map, "chains": dict(taken.chains)}
        units = {"units": dict(self.result.units)} if any(self.result.units.values()) else {}
        return {"name": self.name, "file": file, **units, "observers": observers}


def analyze(
    experiment: Experiment, findings: Sequence[Finding | str] | None = None, *, search: bool = False
) -> Analysis:
    """Simulate an experiment and say what theory promises for it.

    Parameters
    ----------
    experiment : Experiment
    findings : sequence of Finding or str, optional
        What to look for, by name or as a record; everything if omitted.
    search : bool
        Whether to look for what only repeated simulation finds.

    Returns
    -------
    Analysis
        ``observers`` has by label the values that were found, by name, and the reasons why others are missing.

    Raises
    ------
    ConfigError
        When the configuration does not fit together, or no finding is called so.
    SimulationError
        When the plant diverges.

    Examples
    --------
    >>> found = hgorun.analyze(experiment).observers["SHGO"]
    >>> found.values["hurwitz"], [float(pole.real) for pole in found.values["poles"]]  # at theta = 1
    (True, [-1.0, -1.0])
    """
    require_experiment(experiment)
    asked = None if findings is None else _asked(findings)
    run = prepare(experiment)
    return analysis_of(run, simulate_prepared(run), asked, search=search)


def _asked(findings: object) -> tuple[Finding, ...]:
    """Findings of their names, or of themselves."""
    if isinstance(findings, str | Mapping) or not isinstance(findings, Iterable):
        raise ConfigError(f"findings: expected a list of names, such as ['poles'], found {describe(findings)}")
    return tuple(map(_finding, findings))


def _finding(asked: object) -> Finding:
    if isinstance(asked, Finding):
        return asked
    if not isinstance(asked, str):
        raise ConfigError(f"findings: expected a list of names, such as ['poles'], found {describe(asked)} in it")
    try:
        return FINDINGS.find(asked)
    except KeyError:
        known = FINDINGS.names()
        message = f"findings: no finding is called {asked!r:.50}.{nearest(asked, known)} Known: {listed(known, asked)}"
        raise ConfigError(message) from None


def analysis_of(
    run: PreparedRun, result: Result, findings: Sequence[Finding] | None = None, *, search: bool = False
) -> Analysis:
    """The same for a run that has been simulated."""
    with run.experiment.located():
        run.experiment.require_open(
            "the analysis is of an observer beside a plant whose inputs are functions of time; in a closed loop they "
            "follow from its estimates"
        )
    asked = all_findings() if findings is None else tuple(findings)
    context = Context(run, since_start(run, result), search)
    with run.experiment.located():
        observers = {label: _findings_of(subject, asked) for label, subject in context.subjects.items()}
    return Analysis(run.experiment.name, asked, observers, result, context)


def _applies(finding: Finding, subject: Subject) -> bool:
    with called("finding", finding.name, "applies"):
        return finding.applies(subject)


def _value_of(finding: Finding, subject: Subject) -> Value | Remarked:
    """What a finding says; one that fails has a reason, and the others go on."""
    try:
        with called("finding", finding.name, "the function"):
            value = finding(subject)
    except PluginError as error:
        if isinstance(error.__cause__, np.linalg.LinAlgError):
            raise error.__cause__ from None  # a singular matrix is a reason in its own words
        raise NoValue(str(error)) from error
    said: object = value.value if isinstance(value, Remarked) else value
    if not isinstance(said, (bool, int, float, complex, str, np.ndarray, np.generic, Mapping, list, tuple)):
        raise NoValue(
            f"finding {finding.name!r}: it returned {type(said).__name__}, expected a number, a truth, text, an array "
            "or a mapping of such"
        )
    return value


def _findings_of(subject: Subject, findings: Sequence[Finding]) -> Findings:
    asked = {finding.name: finding for finding in findings if _applies(finding, subject)}
    found, reasons = outcomes(asked, lambda name: _value_of(asked[name], subject))
    reasons = {name: reason for name, reason in reasons.items() if not asked[name].optional}
    values: dict[str, Value | None] = {}
    remarks: list[str] = []
    for name in asked:
        value = found.get(name)
        if isinstance(value, Remarked):
            remarks += value.remarks
            value = value.value
        if name in found or name in reasons:
            values[name] = value
    return Findings(values, reasons, tuple(dict.fromkeys(remarks)))
