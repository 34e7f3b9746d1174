"""The exceptions of hgorun. Their messages are written for the person at the terminal."""

from __future__ import annotations


class HgorunError(Exception):
    """Something that the user can put right. ``exit_code`` is what the command line returns."""

    exit_code = 1


class ConfigError(HgorunError):
    """The input is wrong.

    Parameters
    ----------
    message : str
        What is wrong, what was found and what would be right.
    file, line, key : optional
        Where: the message then starts ``file:line: key: ``.
    """

    exit_code = 2

    def __init__(
        self, message: str, *, file: str | None = None, line: int | None = None, key: str | None = None
    ) -> None:
        self.message, self.file, self.line, self.key = message, file, line, key
        # an assignment on the command line has no lines
        where = f"{file}:{line}" if file and line and not file.startswith("--set ") else file
        super().__init__(": ".join(part for part in (where, key, message) if part))


class SimulationError(HgorunError):
    """The run could not be finished, for instance because the plant itself diverged."""


class Problem(ValueError):
    """Something wrong at a key of the configuration; whoever knows the file adds file and line.

    Parameters
    ----------
    path : tuple
        Keys and list indices from the top of the file.
    message : str
    """

    def __init__(self, path: tuple[str | int, ...], message: str) -> None:
        self.path, self.message = path, message
        super().__init__(message)


class NotObservableForm(HgorunError):
    """The plant is not in the class that an observer is for; the message says why."""

    exit_code = 2
