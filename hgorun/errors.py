"""The exceptions of hgorun. Their messages are written for the person at the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TypeAlias

KeyPath: TypeAlias = tuple[str | int, ...]  # keys and list indices from the top of a file

_LONGEST = 1_000  # characters of a message: names and values in it come from anywhere
_MOST_OTHERS = 9  # faults that are told beside the first
_MORE = "there are more faults: they are told when some of these are put right"
_UNSEEN = {
    "\N{NO-BREAK SPACE}": "a non-breaking space",
    "\N{NARROW NO-BREAK SPACE}": "a narrow non-breaking space",
    "\N{FIGURE SPACE}": "a figure space",
    "\N{THIN SPACE}": "a thin space",
    "\N{IDEOGRAPHIC SPACE}": "an ideographic space",
    "\N{ZERO WIDTH SPACE}": "a space of no width",
    "\N{WORD JOINER}": "a word joiner, which has no width",
    "\N{ZERO WIDTH NO-BREAK SPACE}": "a byte order mark",
}  # copied from a page or a text, as a rule; they look like a space, or like nothing


def printable(text: str) -> str:
    """A text as it may stand on a terminal, on one line: control characters and escapes are replaced."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)


def named_unseen(text: str) -> str:
    """What is to be said of a character that looks like a space, or like nothing; empty where there is none.

    It may stand in the text as it is, or as ``repr`` writes it.
    """
    for char, name in _UNSEEN.items():
        if char in text or repr(char)[1:-1] in text:
            return f"\N{REPLACEMENT CHARACTER} is {name} (U+{ord(char):04X}): type a plain space, or none"
    return ""


def _shown(text: str) -> str:
    """A message on one line, without its middle where it is very long; what cannot be seen in it is named."""
    told = named_unseen(text)
    for char in _UNSEEN if told else ():
        text = text.replace(repr(char)[1:-1], char)
    text = printable(text.replace("\n", " "))
    text = text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 4 :]}"
    return f"{text}{' ' if text.endswith('?') else '; '}{told}" if told else text


class HgorunError(Exception):
    """Something that the user can put right. ``exit_code`` is what the command line returns."""

    exit_code = 1

    def __str__(self) -> str:
        return _shown(super().__str__())


class ConfigError(HgorunError):
    """The input is wrong.

    Parameters
    ----------
    message : str
        What is wrong, what was found and what would be right.
    file, line, key : optional
        Where: the message then starts with ``file:line: key:``.

    Attributes
    ----------
    others : tuple of ConfigError
        Further faults of the same input, which do not follow from this one.
    """

    exit_code = 2

    def __init__(
        self, message: str, *, file: str | None = None, line: int | None = None, key: str | None = None
    ) -> None:
        self.message, self.file, self.line, self.key = message, file, line, key
        self.others: tuple[ConfigError, ...] = ()
        # an assignment on the command line has no lines
        where = f"{file}:{line}" if file and line and not file.startswith("--set ") else file
        super().__init__(": ".join([*(_shortened(part) for part in (where, key) if part), message]))

    def add_others(self, others: Iterable[ConfigError]) -> None:
        """Keep further faults in ``others``: the first nine, and a word if there are more."""
        found = [*self.others, *islice(others, _MOST_OTHERS + 1)]
        told = [one for one in found if one.message != _MORE]
        more = [ConfigError(_MORE, file=self.file)] if len(found) > len(told) or len(told) > _MOST_OTHERS else []
        self.others = (*told[:_MOST_OTHERS], *more)

    def __reduce__(self) -> tuple[Callable[..., ConfigError], tuple[object, ...]]:
        return _config_error, (self.message, self.file, self.line, self.key, self.others)


def _config_error(
    message: str, file: str | None, line: int | None, key: str | None, others: tuple[ConfigError, ...]
) -> ConfigError:
    error = ConfigError(message, file=file, line=line, key=key)
    error.others = others
    return error


def _shortened(text: str, limit: int = 200) -> str:
    return text if len(text) <= limit else f"{text[: limit - 60]}...{text[-50:]}"


class SimulationError(HgorunError):
    """The run could not be finished, for instance because the plant itself diverged."""


class PlantEnded(SimulationError):
    """The plant cannot be followed beyond some time.

    Attributes
    ----------
    at : float
        When, counted from the start of the run.
    """

    def __init__(self, message: str, at: float = float("nan")) -> None:
        super().__init__(message)
        self.at = at


class PlantDiverged(PlantEnded):
    """The state of the plant is infinite or not a number, with the steps that were made."""


class NoStep(PlantEnded):
    """No step is small enough for the plant."""


class ShortHistory(NoStep):
    """Steps have become so short that a delay reaches further back than those that are kept."""


class PluginError(HgorunError):
    """A class or function that was found by its name raised what it should not have, or returned something wrong.

    The exception that it raised is the cause.

    Parameters
    ----------
    message : str
    of : (str, str), optional
        Its kind and name, by which whoever knows the configuration finds where it is named.
    """

    exit_code = 2

    def __init__(self, message: str, of: tuple[str, str] | None = None) -> None:
        super().__init__(message)
        self.of = of

    def at(self, where: str) -> PluginError:
        """The same with a place in a configuration."""
        return PluginError(f"{where}: {self}")


class PluginWarning(UserWarning):
    """Something of another package is not used; the message says what, and why."""


class Problem(ValueError):
    """Something wrong at a key of the configuration; whoever knows the file adds file and line.

    Parameters
    ----------
    path : tuple
        Keys and list indices from the top of the file.
    message : str
    others : tuple of Problem or ConfigError
        Further faults of the same input, which do not follow from this one.
    """

    def __init__(self, path: KeyPath, message: str, others: tuple[Problem | ConfigError, ...] = ()) -> None:
        self.path, self.message, self.others = path, message, others
        super().__init__(message)

    def __reduce__(self) -> tuple[type[Problem], tuple[object, ...]]:
        return Problem, (self.path, self.message, self.others)


class NotObservableForm(HgorunError):
    """The plant is not in the class that an observer is for; the message says why."""

    exit_code = 2


@contextmanager
def called(kind: str, name: str, method: str) -> Iterator[None]:
    """Around a call of code that anybody may have written: what it raises names kind, name and method.

    Raises
    ------
    PluginError
        In place of any exception but those that are meant for the user.
    """
    try:
        yield
    except (HgorunError, Problem, MemoryError):
        raise
    except Exception as error:
        told, place = raised(error), place_of(error)
        line = f" ({place})" if place and place not in told else ""
        raise PluginError(f"{kind} {name!r}: {method} raised {told}{line}", (kind, name)) from error


_LIBRARIES = sys.stdlib_module_names | {"hgorun", "casadi", "numpy", "scipy", "sympy", "pydantic"}


def place_of(error: BaseException) -> str:
    """File and line of the code of a user that raised, or that called what did; empty where there is none.

    A class whose body or bases a library refuses is called from its first line.
    """
    found, trace = "", error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_globals.get("__name__", "").partition(".")[0] not in _LIBRARIES:
            found = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return found


_OF_SYMBOLS = {  # methods of CasADi's symbols by which Python asks for a value, and what is right
    "__bool__": "`if`, `and`, `or`, `not`, `max` and `min` of Python need a number, and this is a symbol: write "
    "casadi.if_else(condition, a, b), casadi.logic_and, casadi.logic_or, casadi.fmax, casadi.fmin",
    "__int__": "a whole number is needed, and this is a symbol: write casadi.floor",
    "__float__": "a number is needed, and this is a symbol: write casadi.sin, casadi.exp, ... for functions of math",
    "__iter__": "`for` and `sum` of Python do not go through a symbol: write casadi.vertsplit, casadi.sum1",
}


def raised(error: BaseException) -> str:
    """An exception of code that anybody may have written; where a symbol is taken for a number, the place and the way.

    Where CasADi raises it is told by the method, since its text says nothing of what to write.
    """
    said, trace, user = f"{type(error).__name__}: {error}", error.__traceback__, None
    while trace is not None:
        code, own = trace.tb_frame.f_code, trace.tb_frame.f_globals
        if own.get("__name__", "").partition(".")[0] != "casadi":
            user = f"{Path(code.co_filename).name}:{trace.tb_lineno}"
        elif user is not None and code.co_name in _OF_SYMBOLS:
            return f"{type(error).__name__} at {user}: {_OF_SYMBOLS[code.co_name]}"
        elif user is not None and len(set(shapes := _shapes(trace.tb_frame.f_locals.values()))) > 1:
            return f"{type(error).__name__} at {user}: the shapes {' and '.join(map(str, shapes))} do not fit together"
        trace = trace.tb_next
    return said


def _shapes(arguments: Iterable[object]) -> list[tuple[int, ...]]:
    """Those of the symbols and arrays among the arguments of a function."""
    each = [part for one in arguments for part in (one if isinstance(one, (list, tuple)) else [one])]
    found = (getattr(one, "shape", None) for one in each)
    return [shape for shape in found if isinstance(shape, tuple)]
