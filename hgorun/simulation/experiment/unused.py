"""Parameters of a plant written in the configuration that nothing uses: names that were mistyped, as a rule.

A plant that knows its parameters refuses others. One that is written in place, or a chain with an expression, has those
that its block names, so that a mistyped one would change nothing, and a sweep of it would compare equal runs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from hgorun.config.controller import DRIVEN, Controller
from hgorun.config.expressions import CONSTANTS, ExpressionError, nearest, parse
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath, Problem
from hgorun.observers.base import AnyObserver
from hgorun.plants.base import Plant
from hgorun.plants.expressions import parameter_values

_PARAMETERS: KeyPath = ("plant", "parameters")


def refuse_unused(
    source: Source, plant: Plant, observers: Mapping[str, AnyObserver], controller: Controller | None
) -> None:
    """Refuse parameters that nothing uses.

    One whose use was overridden is none of them: an input that ``--set``, a run or an extending file replaces may
    leave its amplitude behind.

    Raises
    ------
    Problem
    """
    written = [name for name in plant.parameters if _was_written_last(source, name)]
    _refuse(written, plant, observers, controller)


def without_places(source: Source) -> Source:
    """The source of a configuration that was checked when it was written: what it leaves unused is taken."""
    known = {path: place for path, place in source.positions.items() if path[:2] != _PARAMETERS}
    return Source(source.data, known)


def refuse_unused_changes(
    touched: Collection[KeyPath],
    plant: Plant,
    observers: Mapping[str, AnyObserver],
    controller: Controller | None,
) -> None:
    """Refuse changes of parameters that nothing uses.

    Parameters
    ----------
    touched : collection of paths
        What has been changed.

    Raises
    ------
    Problem
    """
    changed = [name for name in plant.parameters if any((*_PARAMETERS, name)[: len(path)] == path for path in touched)]
    _refuse(changed, plant, observers, controller)


def _refuse(
    names: list[str], plant: Plant, observers: Mapping[str, AnyObserver], controller: Controller | None
) -> None:
    if not names or plant.known_parameters or not plant.parameters_as_written:
        return
    taken = {*plant.state_names, *plant.input_names, "t"}
    own = _names(_texts_of(plant))
    if controller is not None:
        own = own - {DRIVEN} | controller.names() & plant.parameters.keys()
    if own - {*plant.parameters, *taken} or plant.parameters.keys() & {*taken, *CONSTANTS}:
        return  # a name that is unknown, or is there twice, is refused where it stands, which says more
    used = own | _names(text for observer in observers.values() for text in _texts(observer.model_dump()))
    for name in names:
        if name not in used:
            parameter_values(plant)  # a value that is none says more
            others = [other for other in plant.parameters if other in used]
            raise Problem((*_PARAMETERS, name), f"nothing uses the parameter {name!r}.{nearest(name, others)}")


def _was_written_last(source: Source, name: str) -> bool:
    """Whether a parameter was written after, or with, all else that says what the plant is.

    One of which it is not known where it was written was checked when it was.
    """
    if (*_PARAMETERS, name) not in source.positions:
        return False
    file, line = source.positions[*_PARAMETERS, name]
    if _is_set(file):
        return True
    if any(_is_set(place[0]) for path, place in source.positions.items() if path[:1] in (("plant",), ("observers",))):
        return False
    around = [source.where(_PARAMETERS[:depth]) for depth in (1, 2)]
    return all(file == above and line >= start for above, start in around)


def _is_set(file: str) -> bool:
    return file.startswith("--set ")


def _texts_of(plant: Plant) -> Iterator[str]:
    """All expressions of a plant's block."""
    yield from plant.expressions().values()
    for block in (plant.parameters, plant.inputs, plant.disturbance):
        yield from block.values()


def _texts(value: object) -> Iterator[str]:
    """All texts in a block."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _texts(part)
    elif isinstance(value, (list, tuple)):
        for part in value:
            yield from _texts(part)


def _names(texts: Iterator[str]) -> frozenset[str]:
    """The names in those of the texts that are expressions."""
    found: frozenset[str] = frozenset()
    for text in texts:
        try:
            found |= parse(text).names
        except ExpressionError:
            continue
    return found
