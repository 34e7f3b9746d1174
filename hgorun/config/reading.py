"""A configuration file with the files that it extends and the assignments made on top."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from hgorun.config import yaml_source
from hgorun.config.overrides import merge, set_path
from hgorun.config.separators import misread
from hgorun.config.types import describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.files import real_path
from hgorun.originals import note_originals

_LONGEST_CHAIN = 20  # files that extend each other


def read_source(path: str | Path, overrides: Sequence[str] = (), *, seed: int | None = None) -> tuple[str, Source]:
    """A file's text, and what it says with ``extends`` and overrides applied.

    Raises
    ------
    ConfigError
    """
    require_list(overrides)
    path = Path(path)
    text, source = _read(path)
    return text, overridden(extended(source, path), overrides, seed)


def require_list(overrides: Sequence[str]) -> None:
    """Refuse a text, which is a sequence of letters, and values by paths, as another call takes them.

    Raises
    ------
    ConfigError
    """
    if isinstance(overrides, str):
        raise ConfigError(f"overrides: expected a list, such as [{overrides!r}], found the text {overrides!r}")
    if isinstance(overrides, Mapping):
        shown = [f"{path}={value}" for path, value in islice(overrides.items(), 1)]
        raise ConfigError(
            f"overrides: expected a list, such as {shown}, found a mapping; varied(...) of an experiment takes one"
        )
    if (other := next((one for one in overrides if not isinstance(one, str)), None)) is not None:
        raise ConfigError(f"overrides: expected a list of texts path=value, found {describe(other)} in it")


def overridden(source: Source, overrides: Sequence[str], seed: int | None) -> Source:
    """The same with assignments, and with another seed where one is given.

    Raises
    ------
    ConfigError
    """
    for assignment in overrides:
        source = set_path(source, assignment)
    return source if seed is None else set_path(source, f"seed={seed}")


def mapping(source: Source, keys: str) -> dict[str, Any]:
    """What a file says, which has to be keys with values; ``keys`` are some that are expected.

    Raises
    ------
    ConfigError
    """
    if isinstance(source.data, dict):
        return source.data
    file, line = source.where(())
    remedy = misread(source.data) if isinstance(source.data, str) else ""
    message = f"expected keys such as {keys} with their values, found {describe(source.data)}{remedy and f'; {remedy}'}"
    raise ConfigError(message, file=file, line=line)


def extended(source: Source, path: Path) -> Source:
    """What a file says, or a part of it, on top of the files that it extends.

    Raises
    ------
    ConfigError
    """
    return _extended(source, path, [real_path(path)])


def _read(path: Path) -> tuple[str, Source]:
    """Read a YAML file; anything else, such as a pipe, might never end."""
    if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
        raise ConfigError("not a regular file", file=str(path))
    note_originals([path])
    return yaml_source.read(path)


def _extended(source: Source, path: Path, seen: list[Path]) -> Source:
    """The file on top of the one that it extends, if any."""
    if not isinstance(source.data, dict) or "extends" not in source.data:
        return source
    base = source.data["extends"]
    file, line = source.where(("extends",))
    if not isinstance(base, str):
        raise ConfigError(f"expected the name of a file, found {describe(base)}", file=file, line=line, key="extends")
    target = path.parent / base
    try:
        _, parent = _read(target)
    except ConfigError as error:
        if error.line is None:
            message = f"{target}: {error.message}"
            raise ConfigError(message, file=file, line=line, key="extends") from error
        raise
    if not isinstance(parent.data, dict):
        message = f"{target} holds {describe(parent.data)}; a mapping with keys such as time and plant was expected"
        raise ConfigError(message, file=file, line=line, key="extends")
    if real_path(target) in seen:
        raise ConfigError(
            f"{base} extends itself, directly or through other files", file=file, line=line, key="extends"
        )
    if len(seen) > _LONGEST_CHAIN:
        raise ConfigError(
            f"a chain of more than {_LONGEST_CHAIN} files that extend each other", file=file, line=line, key="extends"
        )
    parent = _extended(parent, target, [*seen, real_path(target)])
    return merge(parent, source)
