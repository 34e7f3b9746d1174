"""Mappings that people index by names: one that is not there is told with those that are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NoReturn, TypeVar

from hgorun.config.nearest import listed, nearest
from hgorun.errors import printable

V = TypeVar("V")

_LONGEST = 60  # characters of what was asked for


class UnknownName(KeyError):
    """A name that a mapping does not have; the message has those that it has."""

    def __str__(self) -> str:
        return str(self.args[0])  # of a KeyError this is its quoted form


class Named(dict[str, V]):
    """A dictionary by names.

    Parameters
    ----------
    entries : mapping of str
    what : str
        What its names are, as a message says it: ``observer``.

    Examples
    --------
    >>> Named({"SHGO": 1}, "observer")["shgo"]
    Traceback (most recent call last):
    hgorun.config.named.UnknownName: no observer is called 'shgo'. Did you mean `SHGO`? Known: SHGO
    """

    def __init__(self, entries: Mapping[str, V], what: str) -> None:
        super().__init__(entries)
        self.what = what

    def __missing__(self, key: object) -> NoReturn:
        raise UnknownName(no_such(self.what, key, self))


def no_such(what: str, name: object, known: Iterable[str]) -> str:
    """What is said of a name that is not there: the one that may be meant, and those that are."""
    names = list(known)
    near = nearest(name, names) if isinstance(name, str) else ""
    asked = printable(repr(name)[:_LONGEST])
    return f"no {what} is called {asked}.{near} Known: {listed(names, str(name))}"


def name_keys(record: object, **whats: str) -> None:
    """Give mappings of a frozen record that it has been made with names, by attribute what each has.

    An attribute that is None stays so.
    """
    for attribute, what in whats.items():
        entries = getattr(record, attribute)
        if entries is not None and not isinstance(entries, Named):
            object.__setattr__(record, attribute, Named(entries, what))
