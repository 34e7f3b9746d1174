"""The forms in which observers see a plant, found once for all of its numbers that lead to the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import get_origin

import casadi as ca
import numpy as np

from hgorun.errors import HgorunError, NotObservableForm, Problem, called
from hgorun.memo import Memo, same
from hgorun.observers.base import OBSERVERS, AnyObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import RecallsInputs
from hgorun.observers.recalling import RecallingObserver
from hgorun.observers.stepped import SteppedObserver
from hgorun.plants.build import BuiltPlant
from hgorun.result.records.observer import Coordinates
from hgorun.simulation.design.first_inputs import started
from hgorun.symbolic.domains import first_undefined
from hgorun.symbolic.evaluate import at
from hgorun.symbolic.forms import ChosenChains, Form, FormFinder, Redecided
from hgorun.symbolic.observability import CanonicalForms
from hgorun.symbolic.unseen import unseen_states


@dataclass(frozen=True)
class Around:
    """What decides whether observers take a plant, besides its equations and numbers.

    Attributes
    ----------
    sampled : bool
        Whether all outputs are sampled.
    past : bool
        Whether observers can look back at signals of their own: not in closed loops, and not of data.
    untimed : tuple of int
        The inputs that are no functions of time, by their numbers.
    """

    sampled: bool = False
    past: bool = True
    untimed: tuple[int, ...] = ()


_FOUND: Memo[list[tuple[Form, Redecided | None]]] = Memo(256)  # by plant and function
_DECIDED: Memo[tuple[Form, Form]] = Memo(256)  # by numbers, too
_COORDINATES: Memo[Coordinates | None] = Memo(256)  # of forms; to ask for their type again takes longer
_TAKERS: Memo[list[str]] = Memo(4)  # by plant, numbers and what is around them: each observer is tried
_KEPT = 8  # forms of one plant and function
_USUAL = ("shgo", "fhgo2", "ekf")  # named first
_NAMED = 8  # of those that take a plant
_NEED_SAMPLES = (SampledObserver, CorrectedObserver)


def form_of(
    plant: BuiltPlant,
    label: str,
    observer: AnyObserver,
    noise: Mapping[str, float] | None = None,
    chosen: Coordinates | None = None,
    around: Callable[[], Around] = Around,
) -> tuple[Form, Form]:
    """The form that an observer needs, and the one that was first found: of the same equations, but other numbers.

    Parameters
    ----------
    noise : mapping of str to float, optional
        Standard deviation of the noise of outputs.
    chosen : Coordinates, optional
        Those to take where the observer's keys do not say which, as long as the plant has them.
    around : callable, optional
        What stands around the plant, which is asked where other observers are named for it.

    Raises
    ------
    Problem
        When the plant is not in the observer's class, or does not have the coordinates that the keys ask for.
    """
    function = _finder(plant, label, observer, noise or {}, chosen)
    known = plant.symbolic, function
    numbers = plant.initial.tobytes(), plant.parameters.tobytes()
    try:
        return _DECIDED.get((*known, *numbers), lambda: _decide(plant, function, _FOUND.get(known, list)))
    except NotObservableForm as error:
        if chosen is not None and observer.map == "auto" and not observer.chains:
            return form_of(plant, label, observer, noise, around=around)  # with these numbers the plant has others
        if observer.map != "auto" or observer.chains:
            key = "chains" if observer.chains else "map"
            raise Problem(("observers", label, key), str(error)) from error
        _refuse_undefined(plant)
        raise Problem(("plant",), f"{error}; {_elsewhere(plant, label, observer, around())}") from error
    except Problem:
        raise
    except ValueError as error:
        raise Problem(("plant", "initial"), f"{error}; observer {label} ({observer.type}) needs one") from error
    except Exception as error:
        with called("observer", observer.type, "form"):
            raise error


def coordinates_of(form: Form) -> Coordinates | None:
    """The chains that were taken of several possible ones; None where there is nothing to choose."""
    return _COORDINATES.get(
        same(form), lambda: Coordinates(form.map, form.taken) if isinstance(form, ChosenChains) else None
    )


def _finder(
    plant: BuiltPlant, label: str, observer: AnyObserver, noise: Mapping[str, float], chosen: Coordinates | None
) -> FormFinder:
    """The observer's class of plants, with the coordinates that its keys ask for."""
    finder, outputs = observer.form, plant.model.outputs
    if not isinstance(finder, CanonicalForms):
        for key in ("map", "chains"):
            if key in observer.model_fields_set:
                message = f"{observer.type} has coordinates of its own; this is a key of observers with constant gain"
                raise Problem(("observers", label, key), message)
        return finder
    chains = observer.chains
    if chains and (set(chains) != set(outputs) or sum(chains.values()) < plant.model.n):
        found = ", ".join(f"{name}: {length}" for name, length in chains.items())
        raise Problem(
            ("observers", label, "chains"),
            f"expected a length for each output ({', '.join(outputs)}), {plant.model.n} in all or more; found {found}",
        )
    if len(outputs) == 1:
        return finder.chosen(observer.map, chains, {})
    if chosen is not None and observer.map == "auto" and not chains:
        return finder.chosen(chosen.map, chosen.chains, noise)
    return finder.chosen(observer.map, chains, noise)


_AT = (
    "that is by plant.initial, whatever observers begin with; of recorded data, where it lacks a state, by the "
    "one value that initial of observers has for it, otherwise 0"
)


def _refuse_undefined(plant: BuiltPlant) -> None:
    """Refuse initial values at which the plant itself is not defined, whatever its inputs: no observer takes it there.

    Raises
    ------
    Problem
    """
    model = plant.model
    symbols = [model.t, model.x, model.u, model.p]
    names = [(model.x[i], name) for i, name in enumerate(model.states)]
    rates = ca.Function("rates", symbols, [ca.densify(model.dynamics)])
    some = [(np.zeros(1), plant.initial, np.full(len(model.inputs), u), plant.parameters) for u in (0.0, 0.7312)]
    defined = [np.isfinite(at(rates, *numbers)[0]) for numbers in some]
    for i, name in enumerate(model.states):
        why = None if defined[0][i] or defined[1][i] else first_undefined(model.dynamics[i], symbols, some[1], names)
        if why is not None:
            what = f"the right-hand side of {name} is not a finite number at the start of the run: {why}; {_AT}"
            raise Problem(("plant", *plant.block.place_of(name)), what)


def _elsewhere(plant: BuiltPlant, label: str, observer: AnyObserver, around: Around) -> str:
    """Which observers take the plant, in place of one that does not."""
    around = replace(around, sampled=around.sampled or isinstance(observer, _NEED_SAMPLES))
    known = plant.symbolic, plant.initial.tobytes(), plant.parameters.tobytes(), around
    takers = _TAKERS.get(known, lambda: sorted(_takers(plant, around), key=_rank))
    mine = f"observer {label} ({observer.type}) needs another form of the plant"
    unseen = " (which carry that state along, uncorrected)" if unseen_states(plant.model) else ""
    if observer.type in takers:  # with other keys, which ask for another form
        usual = observer.example(plant.model.states)
        own = [key for key in ("q", "theta") if key in observer.model_fields_set and key not in usual]
        if own and "Q" in usual:
            which = unseen.replace("which carry", "and carries")
            mine = f"observer {label} ({observer.type}) with {own[0]} needs another form of the plant"
            return f"{mine}; with Q in place of {own[0]} it takes this one{which}"
        takers = [name for name in takers if name != observer.type]
    if not takers:
        return f"{mine}, and no other observer accepts this plant"
    more = f"; {len(takers) - _NAMED} more of hgorun list observers take it" if len(takers) > _NAMED else ""
    return f"{mine}; observers for this plant are {', '.join(takers[:_NAMED])}{unseen}{more}"


def _rank(name: str) -> int:
    return _USUAL.index(name) if name in _USUAL else len(_USUAL)


def _takers(plant: BuiltPlant, around: Around) -> Iterator[str]:
    """The families that find their form of the plant, and a gain for it; those that need samples on request."""
    for name, family in OBSERVERS.all().items():
        if issubclass(family, _NEED_SAMPLES) and not issubclass(family, SteppedObserver) and not around.sampled:
            continue
        if issubclass(family, RecallingObserver) and not around.past:
            continue
        if any(field.is_required() and get_origin(field.annotation) is dict for field in family.model_fields.values()):
            continue  # it is told of the plant what does not follow from the equations, as the yields of reactions
        try:
            block = family.model_validate({"type": name, **family.example(plant.model.states)})
            form = family.form(plant.model, plant.initial, plant.parameters)
            block.design(form)
            started(form, plant.initial, plant, False)
            if issubclass(family, RecallsInputs) and any(map(form.plant.depends_on_input, around.untimed)):
                continue
        except (HgorunError, ValueError):  # Problem is a ValueError; a class that fails takes no plant
            continue
        yield name


def _decide(plant: BuiltPlant, function: FormFinder, origins: list[tuple[Form, Redecided | None]]) -> tuple[Form, Form]:
    """``origins``: the forms first found, and again those of them that can tell whether they hold on."""
    for origin, telling in origins:
        form = None if telling is None else telling.again(plant.initial, plant.parameters)
        if form is not None:
            return form, origin
    form = function(plant.model, plant.initial, plant.parameters)
    origins.append((form, form if isinstance(form, Redecided) else None))
    del origins[:-_KEPT]
    return form, form
