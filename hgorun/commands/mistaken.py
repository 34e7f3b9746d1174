"""What may stand in the place of a command by mistake."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Sequence
from itertools import takewhile
from shlex import quote

from hgorun.config.nearest import nearest
from hgorun.errors import ConfigError, printable

# What commands are called elsewhere.
_CALLED_ELSEWHERE = {
    **dict.fromkeys(("run", "sim", "solve", "start"), "simulate"),
    **dict.fromkeys(("plot", "draw", "figure", "show-plot"), "compare"),
    **dict.fromkeys(("analyse", "theory", "stability"), "analyze"),
    **dict.fromkeys(("optimize", "optimise", "tuning"), "tune"),
    **dict.fromkeys(("ensemble", "montecarlo", "monte-carlo", "vary"), "sweep"),
    **dict.fromkeys(("new", "create", "template", "example", "examples"), "init"),
    **dict.fromkeys(("info", "describe", "explain"), "show"),
    **dict.fromkeys(("check", "test", "selftest", "version"), "doctor"),
    **dict.fromkeys(("cite-bibtex", "bibtex", "citation"), "cite"),
    **dict.fromkeys(("plants", "observers", "noise", "metrics", "findings", "experiments"), "list"),
    **dict.fromkeys(("help",), "-h"),
}


# Keys of the configuration that are taken for options, and their paths.
_KEYS = {
    **{key: f"observers.LABEL.{key}" for key in ("theta", "poles", "r", "gains", "type", "saturation")},
    **{key: f"measurement.sampling.{key}" for key in ("period", "jitter", "dropout", "offset")},
    **{key: f"measurement.{key}" for key in ("delay", "noise")},
    **{key: f"time.{key}" for key in ("end", "start", "output-step")},
    **{key: f"solver.{key}" for key in ("step", "method", "rtol", "atol", "accuracy")},
    **{key: f"plant.{key}" for key in ("initial", "parameters", "inputs")},
}
_KEY = re.compile(r"[\w.*-]+")  # the path of one
_WITH_SET = {"simulate", "compare", "analyze", "estimate", "export", "explore"}


def _refuse_keys(words: Sequence[str]) -> None:
    """A key of the configuration in the place of an option."""
    for i, word in enumerate(words[1:], 1):
        name, equals, value = word.removeprefix("--").partition("=")
        if word.startswith("--") and name in _KEYS and words[0] in _WITH_SET:
            following = words[i + 1] if i + 1 < len(words) and not words[i + 1].startswith("-") else "VALUE"
            path = _KEYS[name].replace("-", "_")
            raise ConfigError(
                f"there is no option --{name}: keys of the configuration are changed by "
                f"--set {quote(printable(f'{path}={value if equals else following}'))}"
                + (", where LABEL is that of the observer" if "LABEL" in path else "")
            )


def _refuse_spaces(words: Sequence[str]) -> None:
    """An assignment with a space in the place of ``=``, whose value would be taken for a file."""
    for i, word in enumerate(words[:-1]):
        if word == "--set" and "=" not in words[i + 1] and _KEY.fullmatch(words[i + 1]):
            path = words[i + 1]
            right = quote(printable(_assignment(path, words[i + 2 :])))
            raise ConfigError(f"--set {printable(path)}: expected path=value, as in --set {right}")


def _assignment(path: str, following: Sequence[str]) -> str:
    """What is meant by a path and the words behind it, which spaces have parted from it."""
    values = [*takewhile(lambda word: not word.startswith("-"), following), "VALUE"]
    first = values[0]
    if first == "=":
        return f"{path}={values[1]}"
    if first.startswith("="):
        return f"{path}{first}"
    return f"{path} {first}" if "=" in first else f"{path}={first}"  # a label may have a space


def refuse_what_is_no_command(words: Sequence[str], commands: Collection[str]) -> None:
    """Where a file or another program's word stands in the place of a command, say what would be right.

    Raises
    ------
    ConfigError
    """
    first = words[0] if words else ""
    if first in _CALLED_ELSEWHERE:
        more = f" {first}" if _CALLED_ELSEWHERE[first] == "list" else ""
        raise ConfigError(f"there is no command {first!r}. Did you mean `hgorun {_CALLED_ELSEWHERE[first]}{more}`?")
    suffix = os.path.splitext(first)[1].lower()
    if suffix in (".yaml", ".yml"):
        raise ConfigError(f"a command comes first: hgorun simulate {printable(first)}")
    if suffix in (".h5", ".nc", ".hdf5"):
        raise ConfigError(f"a command comes first: hgorun compare {printable(first)}")
    if first and not first.startswith("-") and first not in commands:
        hint = nearest(first, commands)
        raise ConfigError(f"there is no command {printable(first)!r}.{hint} hgorun -h lists them")
    _refuse_keys(words)
    _refuse_spaces(words)
