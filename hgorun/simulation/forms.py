"""The forms in which observers see a plant, found once for all of its numbers that lead to the same."""

from __future__ import annotations

from hgorun.errors import NotObservableForm, Problem
from hgorun.memo import Memo
from hgorun.observers.base import AnyObserver
from hgorun.plants.build import BuiltPlant
from hgorun.symbolic.forms import Form, FormFinder, Redecided

_FOUND: Memo[list[Form]] = Memo(256)  # by plant and function
_DECIDED: Memo[tuple[Form, Form]] = Memo(256)  # by numbers, too
_KEPT = 8  # forms of one plant and function


def form_of(plant: BuiltPlant, label: str, observer: AnyObserver) -> tuple[Form, Form]:
    """The form that an observer needs, and the one that was first found: of the same equations, but other numbers.

    Raises
    ------
    Problem
        When the plant is not in the observer's class.
    """
    function = observer.form
    known = plant.symbolic, function
    numbers = plant.initial.tobytes(), plant.parameters.tobytes()
    try:
        return _DECIDED.get((*known, *numbers), lambda: _decide(plant, function, _FOUND.get(known, list)))
    except NotObservableForm as error:
        raise Problem(
            ("plant",), f"{error}; observer {label} ({observer.type}) asks for another form of the plant"
        ) from error
    except Problem:
        raise
    except ValueError as error:
        raise Problem(("plant", "initial"), f"{error}; observer {label} ({observer.type}) needs one") from error


def _decide(plant: BuiltPlant, function: FormFinder, origins: list[Form]) -> tuple[Form, Form]:
    for origin in origins:
        form = origin.again(plant.initial, plant.parameters) if isinstance(origin, Redecided) else None
        if form is not None:
            return form, origin
    form = function(plant.model, plant.initial, plant.parameters)
    origins.append(form)
    del origins[:-_KEPT]
    return form, form
