"""What the papers of Lee, Meiners and Katayama assume and conclude, for the observers that are theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from hgorun.analysis.findings import Context, Findings
from hgorun.analysis.papers.katayama import katayama_conditions
from hgorun.analysis.papers.lee import lee_conditions
from hgorun.analysis.papers.meiners import meiners_conditions
from hgorun.observers.deadbeat import DeadbeatObserver
from hgorun.observers.direct import DirectObserver
from hgorun.observers.forward_differences import ForwardDifferences
from hgorun.observers.praly_gain import DynamicGain
from hgorun.observers.reduced_sampled import ReducedSampledObserver

_PAPERS: tuple[tuple[str, tuple[type, ...], Callable[..., Any]], ...] = (
    ("lee", (ForwardDifferences,), lee_conditions),
    ("meiners", (DirectObserver, DynamicGain), meiners_conditions),
    ("katayama", (ReducedSampledObserver, DeadbeatObserver), katayama_conditions),
)


def conditions(context: Context) -> dict[str, Findings]:
    """A mapping under the paper's name: conditions, constants, certificates, bounds beside what was measured."""
    found = {}
    for label, observer in context.run.experiment.observers.items():
        findings = Findings()
        for name, families, conditions_of in _PAPERS:
            if isinstance(observer, families):
                values = conditions_of(context.run, label, context.result)
                if isinstance(values, str):
                    findings.withhold(values, name)
                else:
                    findings.give(**{name: asdict(values)})
        found[label] = findings
    return found
