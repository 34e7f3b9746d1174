"""A block checked against its model: the first thing wrong, in the file's words."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import ValidationError

from hgorun.config.types import Block, describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError

_B = TypeVar("_B", bound=Block)


def validate(model: type[_B], data: Any, source: Source, path: tuple[str | int, ...]) -> _B:
    """Check a block; the first thing wrong becomes a ConfigError."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _explained(error, source, path) from None


def _explained(error: ValidationError, source: Source, path: tuple[str | int, ...]) -> ConfigError:
    candidates = []
    for item in error.errors(include_url=False):
        where = _known_path(source, path, item["loc"])
        if item["type"] in ("unknown_key", "no_value", "unknown_type"):
            where = (*where, item["ctx"]["key"])
        file, line = source.where(where)
        candidates.append((line, where, file, _sentence(item)))
    line, where, file, message = min(candidates, key=lambda c: c[0])
    return ConfigError(message, file=file, line=line, key=".".join(map(str, where)) or None)


def _known_path(source: Source, path: tuple[str | int, ...], location: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """The part of pydantic's location that is in the file: names of union members are not."""
    for i, part in enumerate(location):
        if (*path, part) in source.positions or (
            # a missing key is not in the file
            i == len(location) - 1 and isinstance(part, str) and part.isidentifier()
        ):
            path = (*path, part)
    return path


def _sentence(item: Any) -> str:
    kind, message = item["type"], str(item["msg"])
    if kind == "missing":
        return "this key is missing"
    if kind == "value_error":
        return message.removeprefix("Value error, ")
    if kind in ("unknown_key", "no_value", "not_a_mapping", "unknown_type"):
        return message
    if kind in ("tuple_type", "dict_type", "list_type"):
        return f"expected {'a mapping' if kind == 'dict_type' else 'a list'}, found {describe(item['input'])}"
    return f"{message[0].lower()}{message[1:]}, found {describe(item['input'])}"
