"""A JSON schema in fewer words: it accepts the same documents.

Pydantic writes every block in full, with a title for each key. Here unions of plain types become lists of types, and
what several blocks have in common stands once, so that editors have less to read.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

Schema: TypeAlias = dict[str, Any]

_NAMED = ("properties", "$defs")  # keywords whose value is a mapping of names to schemas
_LISTED = ("anyOf", "oneOf", "prefixItems")
_SINGLE = ("items", "additionalProperties")
_OF_TYPE = {  # keywords that say something of one type alone, and by which unions may be told apart
    "number": {"minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "multipleOf"},
    "string": {"minLength", "maxLength", "pattern"},
    "array": {"items", "prefixItems", "minItems", "maxItems", "uniqueItems"},
    "object": {"properties", "additionalProperties", "required"},
    "boolean": set(),
    "null": set(),
}
_WORTH = 60  # characters of a key that is shared


def compact(schema: Schema) -> Schema:
    """The same schema with its common parts in ``$defs``.

    Parameters
    ----------
    schema : dict
        With ``$defs``; it stays as it is.
    """
    top = _each(schema, _shorter)
    shared = _shared(top["$defs"])
    definitions = {name: _with_references(one, shared) for name, one in top["$defs"].items()}
    keys = {place["$ref"].removeprefix("#/$defs/"): json.loads(text) for text, place in shared.items()}
    return {**top, "$defs": definitions | keys}


def _each(schema: Any, change: Callable[[Schema], Schema]) -> Any:
    """A schema whose parts and then itself are changed; what is not a schema, such as a default, stays."""
    if not isinstance(schema, dict):
        return schema
    changed = dict(schema)
    for keyword, value in schema.items():
        if keyword in _NAMED:
            changed[keyword] = {name: _each(one, change) for name, one in value.items()}
        elif keyword in _LISTED:
            changed[keyword] = [_each(one, change) for one in value]
        elif keyword in _SINGLE:
            changed[keyword] = _each(value, change)
    return change(changed)


def _shorter(schema: Schema) -> Schema:
    """Without titles, which repeat the key's name, without defaults that say nothing, and with unions as lists."""
    kept = {key: value for key, value in schema.items() if key != "title" and (key, value) != ("default", None)}
    for union in ("anyOf", "oneOf"):
        if union in kept and (merged := _merged(kept[union])) is not None and not merged.keys() & kept.keys():
            del kept[union]
            kept |= merged
    return kept


def _merged(alternatives: list[Schema]) -> Schema | None:
    """One schema for alternatives of different types; None where they cannot be told apart by their types."""
    found: Schema = {"type": []}
    for one in alternatives:
        types = one.get("type")
        names = types if isinstance(types, list) else [types]
        kinds = {_kind(name) for name in names if isinstance(name, str)}
        allowed = {"type"}.union(*(_OF_TYPE.get(kind, set()) for kind in kinds))
        if not kinds or not one.keys() <= allowed or kinds & {_kind(name) for name in found["type"]}:
            return None
        found = {**found, **one, "type": [*found["type"], *names]}
    return found


def _kind(name: str) -> str:
    """An integer is a number, too."""
    return "number" if name == "integer" else name


def _shared(definitions: Mapping[str, Schema]) -> dict[str, dict[str, str]]:
    """{text of a key's schema: reference to it}, of those that several definitions have."""
    found = [(name, _text(one)) for _, block in sorted(definitions.items()) for name, one in _keys(block)]
    count, used = Counter(text for _, text in found), Counter[str]()
    shared: dict[str, dict[str, str]] = {}
    for name, text in found:
        if count[text] > 1 and len(text) > _WORTH and text not in shared:
            used[name] += 1
            number = f"-{used[name]}" if used[name] > 1 else ""
            shared[text] = {"$ref": f"#/$defs/key-{name}{number}"}  # no class has such a name
    return shared


def _keys(block: Schema) -> Iterator[tuple[str, Schema]]:
    yield from block.get("properties", {}).items()


def _with_references(block: Schema, shared: Mapping[str, Schema]) -> Schema:
    """A definition in which shared keys are referred to."""
    if "properties" not in block:
        return block
    return {**block, "properties": {name: shared.get(_text(one), one) for name, one in _keys(block)}}


def _text(schema: Schema) -> str:
    return json.dumps(schema, sort_keys=True)
