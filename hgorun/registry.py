"""Things that are found by name: what hgorun brings itself, and what other packages add.

A built-in thing lies in a package of its kind, one file each, and is registered when its file is imported.
Other packages name theirs in an entry point of the kind's group. A name belongs to the built-in thing, then to
whoever comes first; another one is not used, and a :class:`PluginWarning` names both. Whoever owns a kind makes one
registry::

    OBSERVERS: Registry[type[Observer]] = Registry(
        "observer", package="hgorun.observers", group="hgorun.observers",
        accepts=is_observer, expected="a class derived from hgorun.observers.base.Observer",
    )
    observer = OBSERVERS.register        # the decorator
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Generic, TypeGuard, TypeVar

from hgorun.errors import HgorunError, PluginError, PluginWarning, place_of

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")
Registered = TypeVar("Registered")


class Registry(Generic[T]):
    """The things of one kind by their names.

    Parameters
    ----------
    kind : str
        What one of them is called in messages: ``"observer"``.
    package : str
        The package whose files hold the built-in ones. A file may hold several; one whose name is the
        file's is found without importing the others.
    group : str
        The entry-point group of other packages.
    accepts : callable
        Whether an object is a thing of this kind.
    expected : str
        What it has to be, for messages: ``"a class derived from ..."``.
    """

    def __init__(
        self, kind: str, *, package: str, group: str, accepts: Callable[[object], TypeGuard[T]], expected: str
    ) -> None:
        self.kind, self.group = kind, group
        self._package, self._accepts, self._expected = package, accepts, expected
        self._registered: dict[str, T] = {}
        self._complete = False  # whether all built-in ones have been imported
        self._importing, self._underway = RLock(), False
        self._settled: set[tuple[str, str]] = set()  # names and values of entry points that were looked at

    def register(self, name: str) -> Callable[[Registered], Registered]:
        """A decorator that registers a thing under the name that YAML files use, and returns it unchanged.

        Raises
        ------
        HgorunError
            When it is not of this kind, or the name is taken by another one.
        """

        def add(thing: Registered) -> Registered:
            self.add(name, thing)
            return thing

        return add

    def add(self, name: str, thing: object) -> T:
        """Register a thing; returns it, typed. Raises like :meth:`register`."""
        if not self._accepts(thing):
            raise HgorunError(f"the {self.kind} {name!r} must be {self._expected}; found {_described(thing)}")
        known = self._registered.setdefault(name, thing)
        if known is not thing:
            if _described(known) != _described(thing):  # a module that is loaded again may replace its own
                raise HgorunError(
                    f"the {self.kind} {name!r} is {_described(known)} already; {_described(thing)} needs another name"
                )
            self._registered[name] = thing
        return thing

    def find(self, name: str) -> T:
        """The thing of this name.

        Raises
        ------
        KeyError
            When there is none.
        HgorunError
            When another package names one that cannot be loaded, or is something else.
        """
        if name not in self._registered and name.isidentifier() and find_spec(f"{self._package}.{name}"):
            import_module(f"{self._package}.{name}")
        if name not in self._registered:
            self._import_built_in()
        for entry in self._entry_points():
            if entry.name == name:
                self._load(entry)
        return self._registered[name]

    def forget(self, name: str) -> None:
        """Take a name away again, if it is there; what a test has registered."""
        self._registered.pop(name, None)
        self._settled = {settled for settled in self._settled if settled[0] != name}

    @contextmanager
    def replaced(self, name: str, thing: object) -> Iterator[T]:
        """A name that stands for another thing for a while, as a test of that thing needs it."""
        before = self._registered.pop(name, None)
        try:
            yield self.add(name, thing)
        finally:
            self._registered.pop(name, None)
            if before is not None:
                self._registered[name] = before

    def names(self) -> list[str]:
        """All names, sorted; without those of other packages that cannot be loaded, which :meth:`find` reports."""
        self._import_built_in()
        for entry in self._entry_points():
            with suppress(HgorunError):
                self._load(entry)
        return sorted(self._registered)

    def load(self) -> dict[str, T]:
        """Name: thing, of all that can be found by name.

        Raises
        ------
        HgorunError
            When another package names one that cannot be loaded, or is something else.
        """
        self._import_built_in()
        for entry in self._entry_points():
            self._load(entry)
        return self._registered.copy()

    def all(self) -> dict[str, T]:
        """Name: thing, of all names."""
        return {name: self._registered[name] for name in self.names()}

    def _import_built_in(self) -> None:
        """Import all built-in ones: other threads wait, and after an interruption whoever asks next goes on."""
        if self._complete:
            return
        with self._importing:
            if self._complete or self._underway:  # a file that asks for names while it is imported gets those so far
                return
            self._underway = True
            try:
                for folder in import_module(self._package).__path__:
                    for file in sorted(Path(folder).glob("*.py")):
                        if not file.stem.startswith("_"):
                            import_module(f"{self._package}.{file.stem}")
                self._complete = True
            finally:
                self._underway = False

    def _entry_points(self) -> tuple[EntryPoint, ...]:
        return _entry_points(self.group, tuple(sys.path))

    def _load(self, entry: EntryPoint) -> None:
        """Register what an entry point names, unless the name belongs to something else."""
        if (entry.name, entry.value) in self._settled:
            return
        known = self._registered.get(entry.name)
        if known is None:
            _FOREIGN.setdefault(_package(entry.module), f"{self.kind} {entry.name!r}")
            self.add(entry.name, self._loaded(entry))
        elif not self._names(entry, known):
            warnings.warn(
                PluginWarning(
                    f"the {self.kind} {entry.name!r} of {entry.value} is not used, since the name belongs to "
                    f"{_described(known)}: its entry point needs another name"
                ),
                stacklevel=2,
            )
        self._settled.add((entry.name, entry.value))

    def _loaded(self, entry: EntryPoint) -> object:
        try:
            return entry.load()
        except Exception as error:  # whatever a stranger's module raises while it is imported
            place = place_of(error)
            reason = f"{type(error).__name__}: {error}" + (f" ({place})" if place else "")
            message = f"the {self.kind} {entry.name!r} of {entry.value} cannot be loaded: {reason}"
            raise PluginError(message, (self.kind, entry.name)) from error

    def _names(self, entry: EntryPoint, known: T) -> bool:
        """Whether an entry point names what is registered already: a decorator may have come first."""
        try:
            return entry.load() is known
        except Exception:  # of a thing that is not used
            return False


_FOREIGN: dict[str, str] = {}  # packages that entry points named, and what for


def foreign_code(error: BaseException) -> str | None:
    """Where in another package's code an exception was raised, in words; None for one of ours.

    Parameters
    ----------
    error : exception
        With its traceback.
    """
    found, trace = None, error.__traceback__
    while trace is not None:
        frame, line = trace.tb_frame, trace.tb_lineno
        owner = _FOREIGN.get(_package(frame.f_globals.get("__name__", "")))
        if owner is not None:
            found = f"{owner}: {frame.f_code.co_name} ({Path(frame.f_code.co_filename).name}, line {line})"
        trace = trace.tb_next
    return found


def _package(module: str) -> str:
    return module.partition(".")[0]


@lru_cache
def _entry_points(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """The entry points of a group in the folders of a path."""
    if not _may_be_in(group, path):
        return ()
    from importlib.metadata import entry_points  # slow to import, and seldom needed

    return tuple(entry_points(group=group))


def _may_be_in(group: str, path: tuple[str, ...]) -> bool:
    """Whether a package on a path may have entry points of a group: False only where their files do not name it."""
    declared = _declared(path)
    return declared is None or group.encode() in declared


@lru_cache
def _declared(path: tuple[str, ...]) -> bytes | None:
    """The texts of all files with entry points on a path; None where packages may be found in other ways."""
    if any(hasattr(finder, "find_distributions") for finder in sys.meta_path if finder is not PathFinder):
        return None
    texts = []
    for folder in path:
        try:
            names = os.listdir(folder or ".")
        except NotADirectoryError:  # an archive
            return None
        except OSError:
            continue
        if any(name.endswith(".egg") for name in names):
            return None
        infos = (name for name in names if name.endswith((".dist-info", ".egg-info")))
        texts += [_content(Path(folder, name, "entry_points.txt")) for name in infos]
    return b"\n".join(texts)


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:  # most packages have no such file
        return b""


def _described(thing: object) -> str:
    """What it is, where it was defined, and what is missing in it."""
    if not isinstance(thing, type):
        return f"{thing!r} of type {type(thing).__name__}"
    missing = ", ".join(sorted(getattr(thing, "__abstractmethods__", ())))
    return f"the class {thing.__module__}.{thing.__qualname__}" + (f": {missing} abstract" if missing else "")
