"""Numbers of the analysis as quantities of claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from hgorun.config.expressions import nearest
from hgorun.errors import Problem
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.result import Result
from hgorun.study.study import Study

if TYPE_CHECKING:
    from hgorun.analysis.report import Analysis


def theory_of(study: Study, results: Mapping[str, Result]) -> Callable[[Quantity], float]:
    """A function that looks numbers up in the analyses of the study's runs, each made once.

    Raises
    ------
    Problem
        By the function: when the analysis has no such number; its reason is in the message.
    """
    from hgorun.analysis.report import analysis_of
    from hgorun.simulation.simulate import prepare, simulate_prepared

    known: dict[str, Analysis] = {}

    def look_up(quantity: Quantity) -> float:
        (name, label), *_ = quantity.of
        if name not in known:
            run = prepare(study.runs[name].experiment)
            known[name] = analysis_of(run, results[name] if name in results else simulate_prepared(run))
        found = known[name].observers[str(label)]
        value: object = found.values
        for part in [*str(quantity.key).split("."), *([quantity.state] if quantity.state else [])]:
            value = value.get(part) if isinstance(value, Mapping) else None
        if isinstance(value, (bool, int, float)):
            return float(value)
        key = str(quantity.key).split(".")[0]
        unknown = "" if key in found.values else f"nothing is called {key!r}.{nearest(key, found.values)}".rstrip()
        reason = found.reasons.get(key) or unknown or "it is not a number"
        raise Problem(("claims",), f"{quantity}: the analysis has no such number: {reason}")

    return look_up
