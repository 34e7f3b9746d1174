"""Laws, what breaks one, and the report of those that were kept."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from pydantic import BaseModel

from hgorun.errors import PluginError, raised

SubjectT = TypeVar("SubjectT")


class ContractError(AssertionError):
    """A law is broken.

    Attributes
    ----------
    subject, law : str
        Whose, and which.
    found, expected : str
        What it does, and what would be right.
    """

    def __init__(self, subject: str, law: str, found: str, expected: str) -> None:
        self.subject, self.law, self.found, self.expected = subject, law, found, expected
        super().__init__(f"{subject} breaks the law {law!r}: found {found}; expected {expected}")


@dataclass(frozen=True)
class Report:
    """The outcome of a check that nothing broke.

    Attributes
    ----------
    subject : str
        The class that was checked.
    kept : tuple of str
        The laws that it keeps.
    left_out : mapping of str to str
        Laws that do not apply or were skipped, with the reason.
    """

    subject: str
    kept: tuple[str, ...]
    left_out: Mapping[str, str]

    def __str__(self) -> str:
        lines = [f"{self.subject} keeps {len(self.kept)} laws: {', '.join(self.kept)}"]
        return "\n".join([*lines, *(f"  not checked: {law}: {reason}" for law, reason in self.left_out.items())])


class Broken(Exception):
    """Raised by a law: what was found, and what would be right."""

    def __init__(self, found: str, expected: str) -> None:
        self.found, self.expected = found, expected
        super().__init__(f"found {found}; expected {expected}")


def keys_are_described(cls: type[BaseModel]) -> None:
    """A law of every block, but for its ``type``, which the program describes.

    Raises
    ------
    Broken
    """
    for key, field in cls.model_fields.items():
        if not field.description and key != "type":
            raise Broken(f"the key {key} without description", "Field(description=...) for every key")


class NotApplicable(Exception):
    """Raised by a law that is not for this subject; the message says why."""


@dataclass(frozen=True)
class Law(Generic[SubjectT]):
    """A law with its name, what it says, and the function that raises :class:`Broken`."""

    name: str
    sentence: str
    check: Callable[[SubjectT], None]


def hold_to(name: str, subject: SubjectT, laws: Sequence[Law[SubjectT]], skip: Collection[str]) -> Report:
    """Check the laws one after the other.

    Raises
    ------
    ContractError
        For the first that is broken.
    ValueError
        When ``skip`` names a law that does not exist.
    """
    known = [law.name for law in laws]
    unknown = [law for law in skip if law not in known]
    if unknown:
        raise ValueError(f"no law is called {', '.join(map(repr, unknown))}; the laws are {', '.join(known)}")
    kept, left_out = [], {}
    for law in laws:
        if law.name in skip:
            left_out[law.name] = "skipped"
            continue
        try:
            law.check(subject)
        except Broken as broken:
            raise ContractError(name, law.name, broken.found, broken.expected) from broken.__cause__
        except NotApplicable as reason:
            left_out[law.name] = str(reason)
        except PluginError as error:
            if error.__cause__ is None:
                raise ContractError(name, law.name, *returned(error)) from error
            raise ContractError(name, law.name, str(error), f"no exception, since {law.sentence}") from error
        except Exception as error:
            what = raised(error)
            raise ContractError(name, law.name, what, f"no exception, since {law.sentence}") from error
        else:
            kept.append(law.name)
    return Report(name, tuple(kept), left_out)


def returned(error: PluginError) -> tuple[str, str]:
    """(found, expected) of a method that returned something of another type: it raised no exception."""
    found, _, expected = str(error).rpartition(", expected ")
    return (found, expected) if found else (expected, "what the base class declares")
