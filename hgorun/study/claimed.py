"""What decides the claims of a file, read from their values; and what is wrong with these."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from hgorun.config.expressions import ExpressionError
from hgorun.config.paths import entries
from hgorun.config.refusals import Refusals
from hgorun.config.study import Claim
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath, Problem
from hgorun.study.sentences import Sentence, read_sentence


def sentences_of(
    claims: Sequence[Claim], runs: tuple[str, ...], labels: Collection[str], source: Source, faults: Refusals
) -> tuple[tuple[Sentence, ...], ...]:
    """What decides claims, as far as it can be read.

    Parameters
    ----------
    claims : sequence of Claim
    runs : tuple of str
        Names of the runs.
    labels : collection of str
        Those of their observers.
    source : Source
    faults : Refusals
        Gets what is wrong with the values and with the names of the claims.
    """
    sentences = []
    seen: set[str] = set()
    for i, claim in enumerate(claims):
        with faults.of_a_part(), source.located():
            values = zip(claim.inequalities, places_of(i, claim), strict=True)
            sentences.append(tuple(_read(one.value, place, runs, labels) for one, place in values))
            if claim.id in seen:
                raise Problem(("claims", i, "id"), f"two claims have the id {claim.id!r}")
            seen.add(claim.id)
    return tuple(sentences)


def check_values(
    claims: object, runs: tuple[str, ...], labels: Collection[str], source: Source, faults: Refusals
) -> None:
    """Find what is wrong with the values of claims, whatever else is wrong with them or with other blocks.

    Parameters
    ----------
    claims : object
        The list as it was written, or what stands in its place.
    runs, labels, source, faults
        As of :func:`sentences_of`.
    """
    for i, claim in entries(claims):
        value = claim.get("value") if isinstance(claim, dict) else None
        with faults.of_a_part(), source.located():
            if isinstance(value, str) and value:
                _read(value, ("claims", i, "value"), runs, labels)


def places_of(number: int, claim: Claim) -> list[KeyPath]:
    """Where the values of a claim stand in the file, in the order of its inequalities."""
    others: list[KeyPath] = [("claims", number, "alternatives", k, "value") for k in range(len(claim.alternatives))]
    return [("claims", number, "value"), *others] if claim.value else []


def _read(value: str, place: KeyPath, runs: tuple[str, ...], labels: Collection[str]) -> Sentence:
    try:
        return read_sentence(value, runs, labels)
    except ExpressionError as error:
        raise Problem(place, str(error)) from error
