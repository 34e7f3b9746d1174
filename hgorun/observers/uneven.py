"""Lists of numbers for the chains of a plant, where chains are not equally long."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.errors import Problem
from hgorun.symbolic.canonical import CanonicalForm


def refuse_of_uneven_chains(key: str, given: object, form: CanonicalForm, orders: Sequence[int], instead: str) -> None:
    """Refuse a list that is for every chain where no list can be.

    Parameters
    ----------
    key : str
    given : object
        What stands there: a tuple, where it is a list.
    form : CanonicalForm
    orders : sequence of int
        How many numbers each chain needs.
    instead : str
        What may be written in its place.

    Raises
    ------
    Problem
    """
    if not isinstance(given, tuple) or len(set(orders)) < 2:
        return
    (first, count), *others = zip(form.plant.outputs, orders, strict=True)
    needs = ", ".join([f"the chain of {first} needs {count} numbers", *(f"that of {o} {n}" for o, n in others)])
    raise Problem((key,), f"{needs}, so that no list fits all: {instead}, as poles: -1; found {len(given)}")
