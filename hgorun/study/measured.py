"""What the runs of a study are worth: quantities of single runs, and of the members of ensembles."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from hgorun.config.study import Inequality
from hgorun.ensemble.collected.collected import Collected, Floats, shown
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.refused import told_where
from hgorun.errors import SimulationError
from hgorun.result.metrics.base import all_metrics
from hgorun.result.quantities.quantities import exponent, inside, measure_quantity
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.result import Result
from hgorun.study.sentences import Sentence
from hgorun.study.study import Run, Study

_NO_SIZES = frozenset({"mean", "exponent"})  # of an error: without a bound, their sign is not known

Numbers: TypeAlias = Mapping[str, Floats]
"""Of the members of an ensemble, by the texts of quantities: arrays of shape (values, seeds)."""


def asked_of(study: Study, run: str, claims: Sequence[int], figures: Sequence[str]) -> list[Quantity]:
    """The quantities to be measured on every member of an ensemble, without doubles.

    Parameters
    ----------
    claims : sequence of int
        Numbers of the claims.
    figures : sequence of str
    """
    told = [q for i in claims for q in study.quantities(i) if q.function != "analysis"]
    wanted = [q for q in told if q.of[0][0] == run]
    for name in figures:
        for scaled_run, quantities in study.scaled(name).values():
            wanted += quantities if scaled_run == run else []
    return list(dict.fromkeys(map(on_member, wanted)))


def on_member(quantity: Quantity) -> Quantity:
    """What is measured on one member for a quantity of the ensemble."""
    if quantity.function == "exponent":
        return replace(quantity, function="amplitude", window=None)
    return quantity


def beside_metrics(quantities: Sequence[Quantity]) -> list[str]:
    """Those that an ensemble does not keep as metrics, as texts."""
    return [str(q) for q in quantities if q.window is not None or q.function not in all_metrics(closed=True)]


def of_members(run: Run, ensemble: Ensemble, found: Collected, quantities: Sequence[Quantity]) -> Numbers:
    """Quantities of the members of a run's ensemble that has been carried out.

    Raises
    ------
    SimulationError
        Where a member has failed.
    """
    failed = np.flatnonzero(found.error != "")
    if failed.size:
        first = int(failed[0])
        which = ", ".join(f"{axis} {shown(values[first])}" for axis, values in found.axes.items())
        error = told_where(ensemble, first, str(found.error[first]))
        raise SimulationError(
            f"run {run.name}: {failed.size} of {len(found)} members failed, the first with {which}: {error}"
        )
    return {str(q): _of_members(found, q).reshape(run.shape) for q in quantities}


def _of_members(found: Collected, quantity: Quantity) -> Floats:
    if str(quantity) in found.quantities:
        return found.quantities[str(quantity)]
    i = found.observers.index(str(quantity.of[0][1]))
    return found.metrics[quantity.function][:, i, found.states.index(str(quantity.state))]


def values_of(
    study: Study,
    claim: int,
    results: Mapping[str, Result],
    ensembles: Mapping[str, Numbers],
    theory: Callable[[Quantity], float],
) -> list[list[float]]:
    """The value of each inequality of a claim: one number, or one for each member of the ensemble it refers to.

    Of an ensemble of values and seeds there is one for each seed, the mean over the values: these are independent.
    What cannot be known because an observer diverged is NaN: all but that a size of its error, alone, is not below a
    number.

    Parameters
    ----------
    study : Study
    claim : int
        Its number.
    results : mapping of str to Result
        Of the single runs.
    ensembles : mapping of str to Numbers
        What :func:`of_members` has found of the others.
    theory : callable
        Gives a number of the analysis.
    """
    asked = study.claims[claim]
    return [
        _values(study, sentence, one, asked.divergence, results, ensembles, theory)
        for sentence, one in zip(study.sentences[claim], asked.inequalities, strict=True)
    ]


def _values(
    study: Study,
    sentence: Sentence,
    inequality: Inequality,
    of_divergence: bool,
    results: Mapping[str, Result],
    ensembles: Mapping[str, Numbers],
    theory: Callable[[Quantity], float],
) -> list[float]:
    measured: dict[str, Floats] = {}  # each of shape (values, seeds), 1 where it is the same for all of them
    for q in sentence.quantities:
        run = study.runs[q.of[0][0]]
        if q.function == "analysis":
            measured[str(q)] = np.array([[theory(q)]])
        elif run.single:
            measured[str(q)] = np.array([[measure_quantity(q, results)]])
        elif q.function == "exponent":
            amplitudes = ensembles[run.name][str(on_member(q))]
            measured[str(q)] = np.array([[_slope(run, column, q) for column in amplitudes.T]])
        else:
            measured[str(q)] = ensembles[run.name][str(q)]
    of_runs = {str(q): q.function for q in sentence.quantities if q.function != "analysis"}
    size_alone = len(of_runs) == 1 and _NO_SIZES.isdisjoint(of_runs.values())

    def _value(found: Mapping[str, float]) -> float:
        value = sentence.value(found)
        if of_divergence or not any(math.isinf(found[text]) for text in of_runs):
            return value
        # an error without bound is not below one; what else follows from an observer that diverged nobody knows:
        # of A/B and A - B alike, whichever of the two diverged
        return value if size_alone and value == math.inf and not inequality.holds(value) else math.nan

    rows, seeds = np.broadcast_shapes(*(part.shape for part in measured.values()))
    each = {text: np.broadcast_to(part, (rows, seeds)) for text, part in measured.items()}
    table = [[_value({t: float(p[v, s]) for t, p in each.items()}) for s in range(seeds)] for v in range(rows)]
    if seeds == 1:
        return [row[0] for row in table]
    return [float(np.mean(column)) for column in zip(*table, strict=True)]


def _slope(run: Run, amplitudes: Floats, asked: Quantity) -> float:
    """An exponent; infinite where an observer diverged at one of the values that it is drawn through."""
    used = [asked.window is None or inside(value, asked.window) for value in run.values]
    if np.any(np.isinf(amplitudes[used])):
        return math.inf
    return exponent(run.values, amplitudes, asked.window)
