"""Whether the states that are filters by their roles are such."""

from __future__ import annotations

import numpy as np

from hgorun.observers.base import ContinuousObserver
from hgorun.simulation.error_dynamics.filters_at_rest import not_at_zero, rates_and_sizes
from hgorun.testing.cases import Subject
from hgorun.testing.contract import Broken, NotApplicable
from hgorun.testing.equations import Equations


def filters_rest_at_zero(subject: Subject) -> None:
    """Theory takes filters to be zero where the error is: with another state that is another observer."""
    for case in subject.cases:
        equations = case.equations()
        if not isinstance(equations.observer, ContinuousObserver):
            raise NotApplicable("it has no flow")
        wrong = _elsewhere(equations)
        if wrong:
            raise Broken(
                f"{wrong[0]}, a filter, that does not come to rest at 0 while the estimate is right {equations.where}",
                "0 there; or roles() that says gain, if the correction is multiplied by it, or signal",
            )


def _elsewhere(equations: Equations) -> tuple[str, ...]:
    """Filters that come to rest elsewhere than at zero, or nowhere."""
    roles = equations.observer.roles(equations.form)
    filters = {name: block for name, block in equations.states.items() if roles.get(name) == "filter" and block.size}
    if not filters:
        return ()
    rates = equations.function("filters", *rates_and_sizes(equations.rates, filters, equations.z))

    def evaluate(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rate, size = (np.ravel(value) for value in equations.evaluate(rates, 0.0, z, np.zeros(equations.outputs)))
        return rate, size

    return not_at_zero(filters, equations.defaults, equations.start(equations.plant.initial), evaluate)
