"""Names of plants and observers.

A built-in one is found by its file: ``hgorun/observers/<name>.py``. Others register through the
entry-point groups ``hgorun.plants`` and ``hgorun.observers``, whose values name the class.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from hgorun.errors import HgorunError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

    from hgorun.observers.base import Observer
    from hgorun.plants.base import Plant

_T = TypeVar("_T")
_REGISTERED: dict[str, dict[str, type]] = {"plants": {}, "observers": {}}


def observer(name: str) -> Callable[[type[_T]], type[_T]]:
    """Register an observer class under the name that YAML files use."""
    return _register("observers", name)


def plant(name: str) -> Callable[[type[_T]], type[_T]]:
    """Register a plant class under the name that YAML files use."""
    return _register("plants", name)


def find_observer(name: str) -> type[Observer]:
    """The class of an observer; KeyError when there is none."""
    return _find("observers", name)


def find_plant(name: str) -> type[Plant]:
    """The class of a plant; KeyError when there is none."""
    return _find("plants", name)


def names(kind: str) -> list[str]:
    """All names of a kind, ``"plants"`` or ``"observers"``, built-in and registered, of what can be loaded."""
    package = import_module(f"hgorun.{kind}")
    for file in sorted(Path(package.__path__[0]).glob("*.py")):
        if not file.stem.startswith("_"):
            import_module(f"hgorun.{kind}.{file.stem}")
    for entry in _entry_points(kind):
        with suppress(HgorunError):  # a broken package is said to whoever asks for it by name
            _load(kind, entry)
    return sorted(_REGISTERED[kind])


def _register(kind: str, name: str) -> Callable[[type[_T]], type[_T]]:
    def add(cls: type[_T]) -> type[_T]:
        _REGISTERED[kind][name] = cls
        return cls

    return add


def _find(kind: str, name: str) -> type:
    found = _REGISTERED[kind]
    if name not in found and name.isidentifier() and find_spec(f"hgorun.{kind}.{name}"):
        import_module(f"hgorun.{kind}.{name}")
    if name not in found:
        for entry in _entry_points(kind).select(name=name):
            _load(kind, entry)
    return found[name]


def _entry_points(kind: str) -> EntryPoints:
    from importlib.metadata import entry_points

    return entry_points(group=f"hgorun.{kind}")


def _load(kind: str, entry: EntryPoint) -> None:
    if entry.name not in _REGISTERED[kind]:
        try:
            _REGISTERED[kind][entry.name] = entry.load()
        except Exception as error:
            raise HgorunError(f"the {kind[:-1]} {entry.name!r} of {entry.value} cannot be loaded: {error}") from error
