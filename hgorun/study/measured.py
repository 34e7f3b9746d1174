"""What the runs of a study are worth: quantities of single runs and of the members of ensembles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from hgorun.result.result import Result
from hgorun.study.quantities import Quantity, Sentence, exponent, measure_quantity
from hgorun.study.study import Run, Study


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


def measure_members(
    run: Run,
    quantities: Sequence[Quantity],
    done: Sequence[Mapping[str, float]] = (),
    keep: Callable[[list[dict[str, float]]], None] = lambda _: None,
) -> list[dict[str, float]]:
    """Run all members of an ensemble.

    Parameters
    ----------
    run : Run
    quantities : sequence of Quantity
        Measured on every member.
    done : sequence of mapping
        What an earlier call has found of the first members.
    keep : callable
        Told what there is after every member.

    Returns
    -------
    list of dict
        For every member {text of the quantity: value}.
    """
    from hgorun.simulation.simulate import simulate

    found = [dict(one) for one in done]
    for experiment in run.members(len(found)):
        result = simulate(experiment)
        found.append({str(q): measure_quantity(q, {run.name: result}) for q in quantities})
        keep(found)
    return found


def values_of(
    study: Study,
    claim: int,
    results: Mapping[str, Result],
    ensembles: Mapping[str, list[dict[str, float]]],
    theory: Callable[[Quantity], float],
) -> list[list[float]]:
    """The value of each inequality of a claim: one number, or one for each seed of the ensembles it refers to.

    Parameters
    ----------
    study : Study
    claim : int
        Its number.
    results : mapping of str to Result
        Of the single runs.
    ensembles : mapping of str to list of dict
        What :func:`measure_members` has found of the others.
    theory : callable
        Gives a number of the analysis.
    """
    return [_values(study, sentence, results, ensembles, theory) for sentence in study.sentences[claim]]


def _values(
    study: Study,
    sentence: Sentence,
    results: Mapping[str, Result],
    ensembles: Mapping[str, list[dict[str, float]]],
    theory: Callable[[Quantity], float],
) -> list[float]:
    fixed: dict[str, float] = {}
    lists: dict[str, list[float]] = {}
    for q in sentence.quantities:
        run = study.runs[q.of[0][0]]
        if q.function == "analysis":
            fixed[str(q)] = theory(q)
        elif run.single:
            fixed[str(q)] = measure_quantity(q, results)
        elif q.function == "exponent":
            amplitudes = [member[str(on_member(q))] for member in ensembles[run.name]]
            fixed[str(q)] = exponent(run.varied, amplitudes, q.window)
        else:
            lists[str(q)] = [member[str(q)] for member in ensembles[run.name]]
    members = min((len(values) for values in lists.values()), default=1)
    return [sentence.value(fixed | {text: values[i] for text, values in lists.items()}) for i in range(members)]
