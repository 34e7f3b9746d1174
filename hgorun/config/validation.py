"""A block checked against its model: the first thing wrong, in the file's words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from hgorun.config.belonging import belongs
from hgorun.config.nearest import nearest
from hgorun.config.paths import at, dotted, entries
from hgorun.config.separators import misread
from hgorun.config.shell import assigned_text
from hgorun.config.tokens import DECIMAL_POINT, ends_a_number
from hgorun.config.types import Block, describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError, KeyPath, Problem

_B = TypeVar("_B", bound=Block)

_MOST = 10  # faults that are told
_OF_A_KEY = ("unknown_key", "no_value")  # of which a block may have several
_OF_BLOCKS = ((), ("data",))  # paths below which what is wrong with one key says nothing of another
_OF_ENTRIES = {"axes", "claims", "figures", "inputs", "outputs", "reference"}
_MEASUREMENT, _OF_PARTS = ("measurement",), {"outputs", "phases"}
_NOTHING = object()
_OF_OBSERVER = 2  # keys of the path to one
_SHOWN = 6  # entries of a list in a message
_OUR_OWN = frozenset({"unknown_key", "no_value", "not_a_mapping", "unknown_type"})  # with messages of ours
_EXPECTED = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a mapping",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "a number above {gt}",
    "greater_than_equal": "a number of at least {ge}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_type": "a whole number",
    "less_than": "a number below {lt}",
    "less_than_equal": "a number of at most {le}",
    "list_type": "a list",
    "literal_error": "{expected}",
    "string_type": "text",
    "too_long": "a list of at most {max_length}",
    "tuple_type": "a list",
}


@dataclass(frozen=True, eq=False, repr=False)
class _Fault:
    """Something wrong, and whether it is so whatever else is wrong.

    Attributes
    ----------
    error : ConfigError
    line : int
    block : tuple
        Of a whole file, ``data`` or ``measurement``, the block that it is in; where a block has entries, the entry.
    mapping : tuple or None
        Where it is a key that is not known, or has no value: the mapping that has it.
    """

    error: ConfigError
    line: int
    block: KeyPath
    mapping: KeyPath | None

    @classmethod
    def at(cls, where: KeyPath, message: str, source: Source, path: KeyPath, mapping: KeyPath | None) -> _Fault:
        """Of what is checked at a path: a fault somewhere in it."""
        file, line = source.where(where)
        key = source.key(where) or None
        return cls(ConfigError(message, file=file, line=line, key=key), line, _block(path, where[len(path) :]), mapping)


def _block(path: KeyPath, own: KeyPath) -> KeyPath:
    """The part of what is checked at a path in which one fault may follow from another."""
    if path in _OF_BLOCKS:
        return own[: 2 if own[:1] and own[0] in _OF_ENTRIES else 1]
    if path != _MEASUREMENT:
        return ()
    if "noise" in own:  # a list, each item of which is of a kind of its own
        return own[: own.index("noise") + 2]
    return own[: 3 if own[:1] and own[0] in _OF_PARTS else 1]


def validate(model: type[_B], data: object, source: Source, path: KeyPath) -> _B:
    """Check a block; the first thing wrong becomes a ConfigError, whose ``others`` are what does not follow from it."""
    try:
        with source.located():
            return model.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        if path == _MEASUREMENT and isinstance(data, dict):
            found += _beside_unknown(model, data, found)
        raise _explained(found, source, path, model) from None


def _beside_unknown(model: type[BaseModel], data: dict[str, Any], found: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """What is wrong with other keys of a block, which is not looked at where one of its keys is not known."""
    unknown = [item["ctx"]["key"] for item in found if item["type"] == "unknown_key" and not item["loc"]]
    try:
        if unknown:
            model.model_validate({key: part for key, part in data.items() if key in model.model_fields})
    except ValidationError as error:
        return [item for item in error.errors(include_url=False) if item["loc"]]
    return []


def _explained(items: Sequence[ErrorDetails], source: Source, path: KeyPath, model: type[BaseModel]) -> ConfigError:
    found: list[_Fault] = []
    for item in items:
        place = where = _known_path(source, path, item["loc"])
        if item["type"] in (*_OF_A_KEY, "unknown_type"):
            where = (*place, item["ctx"]["key"])
        if item["type"] == "value_error" and isinstance(problem := item["ctx"]["error"], Problem):
            where = (*place, *problem.path)  # of a model's own check, from that model on
        message = sentence_of(item) + _meaning(item, model) + _kind(item, where)
        if item["type"] == "unknown_key":
            message = _elsewhere(message, item["ctx"], place, source)
        message += _as_text(item, where, source.where(where)[0])
        message += "" if "written with a point" in message else _comma(source, where)
        mapping = place if item["type"] in _OF_A_KEY else None
        found.append(_Fault.at(where, message, source, path, mapping))
        others = item["ctx"]["others"] if mapping is not None else ()
        for one in others:
            message = _elsewhere(one.message(), one.context, place, source)
            found.append(_Fault.at((*place, one.context["key"]), message, source, path, mapping))
    firsts: dict[KeyPath, _Fault] = {}
    told = []
    for one in sorted(found, key=lambda one: one.line):
        # of a whole file: what is wrong in its other blocks does not follow from the first; nor do keys from each other
        first = firsts.setdefault(one.block, one)
        if first is one or (one.mapping is not None and one.mapping == first.mapping):
            told.append(one.error)
    told[0].others = tuple(told[1:_MOST])
    return told[0]


def _kind(item: ErrorDetails, where: KeyPath) -> str:
    """Of an observer that is a word: the word may be its type."""
    found = item["input"]
    is_type = item["type"] == "dict_type" and where[:1] == ("observers",) and isinstance(found, str)
    is_type = is_type and not misread(found)
    return f", such as {where[-1]}: {{type: {found[:40]}}}" if is_type and len(where) == _OF_OBSERVER else ""


def _elsewhere(message: str, context: dict[str, Any], place: KeyPath, source: Source) -> str:
    """What is said of a key that is not known, with the block that it is a key of, where that is another one."""
    key, hint = context["key"], str(context.get("hint", ""))
    name = f"unknown key {context.get('name')}."
    of_a_configuration = isinstance(source.data, dict) and "base" not in source.data
    where = belongs(place, key, recorded="data" in source.data) if isinstance(key, str) and of_a_configuration else ""
    if not where or not message.startswith(name + hint):
        return message
    if hint.endswith("?"):
        told = hint + where.replace(" Did you mean", " Or", 1)
    else:  # a block that has the key may be one of several
        told = where if not hint or " or " in where else hint
    return name + told + message[len(name + hint) :]


def _comma(source: Source, where: KeyPath) -> str:
    """Of a key without a value that is the end of a decimal number: how the number is written."""
    beside = dict(entries(at(source.data, where[:-1]))) if where and _is_there(source.data, where) else {}
    key = where[-1] if where else ""
    before = list(beside)[: list(beside).index(key)][-1:] if key in beside else []
    if not before or not isinstance(key, str) or beside[key] is not None or not ends_a_number(key):
        return ""
    return f"; if it is the end of a number, {DECIMAL_POINT.rpartition(',')[0]}, as in {beside[before[0]]}.{key}"


def _as_text(item: ErrorDetails, where: KeyPath, file: str) -> str:
    """Of what ``--set`` gives in the place of a text: how it is one, since a shell takes quotes away."""
    name, _, text = file.removeprefix("--set ").partition("=")
    if item["type"] != "string_type" or not file.startswith("--set ") or name != dotted(where):
        return ""
    return f"; as text: `{assigned_text(where, text.strip())}`"


def _known_path(source: Source, path: KeyPath, location: KeyPath) -> KeyPath:
    """The part of pydantic's location that is in the file: names of union members are not."""
    for i, part in enumerate(location):
        if _is_there(source.data, (*path, part)) or (
            # a missing key is not in the file
            i == len(location) - 1 and isinstance(part, str) and part.isidentifier()
        ):
            path = (*path, part)
    return path


def _is_there(data: Any, path: KeyPath) -> bool:
    """Whether a path leads somewhere."""
    for key in path:
        part = dict(entries(data)).get(key, _NOTHING)
        if part is _NOTHING:
            return False
        data = part
    return True


def sentence_of(item: ErrorDetails) -> str:
    """What is wrong, by the type of the error: pydantic's sentences change between its versions."""
    kind, found = item["type"], item["input"]
    if kind == "missing":
        last = item["loc"][-1]
        return "this key is missing" if isinstance(last, str) else _too_few(found, last + 1)
    if kind == "value_error":
        return str(item["ctx"]["error"])
    if kind in _OUR_OWN:
        return item["msg"]
    if kind == "too_long" and isinstance(found, (list, tuple)):
        return f"expected a list of at most {item['ctx']['max_length']}, found a list of {len(found)}"
    expected = _EXPECTED.get(kind, "another value").format_map(item.get("ctx", {}))
    return f"expected {expected}, found {describe(found)}{_hint(item, expected)}"


def _meaning(item: ErrorDetails, model: type[BaseModel]) -> str:
    """What a key that is missing from a block says."""
    field = None
    for part in item["loc"] if item["type"] == "missing" else ():
        kind = model if field is None else field.annotation
        if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
            return ""
        field = kind.model_fields.get(str(part))
        if field is None:
            return ""
    return f": {field.description}" if field is not None and field.description else ""


def _hint(item: ErrorDetails, expected: str) -> str:
    kind, found = item["type"], item["input"]
    if kind == "dict_type" and found is None:
        return "; write lines `name: value`, or leave the key out: null removes only what is inherited by `extends`"
    if kind == "dict_type" and not isinstance(found, dict):
        remedy = misread(found) if isinstance(found, str) else ""
        return f"; {remedy or 'write lines `name: value`'}"
    if kind in ("list_type", "tuple_type"):
        return _as_noise(found) if item["loc"][-1:] == ("noise",) and not isinstance(found, dict) else _as_list(found)
    if kind == "literal_error" and isinstance(found, str):
        near = nearest(found, re.findall(r"'([^']*)'", expected))
        return near and f".{near}"
    return ""


def _as_list(found: object) -> str:
    """What was found, written as a list."""
    if isinstance(found, dict) and any(isinstance(part, (dict, str)) for part in found.values()):
        return "; a list of one is [{...}], or has `- ` before its first key"
    if isinstance(found, dict) and all(isinstance(part, list) for part in found.values()) and found:
        return f"; it is one list, and none for each of {', '.join(map(str, list(found)[:_SHOWN]))}"
    parts = (
        list(found) if isinstance(found, dict) else found.replace(",", " ").split() if isinstance(found, str) else []
    )
    shown = ", ".join(map(str, parts)) if 1 < len(parts) <= _SHOWN else "a, b"
    return f"; a list has brackets: [{shown}]"


def _as_noise(found: object) -> str:
    """A list of one noise, of the type that was found where it is a word."""
    word = found if isinstance(found, str) and found.isidentifier() else "gaussian"
    return f"; a list of one is [{{type: {word[:40]}, {'std: 0.1' if word == 'gaussian' else '...'}}}]"


def _too_few(found: object, least: int) -> str:
    count = len(found) if isinstance(found, (list, tuple)) else 0
    return f"expected a list of at least {least}, found {count}"
