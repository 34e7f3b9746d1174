"""The data of a YAML document from the events of its parser, with the file and line of every entry."""

from __future__ import annotations

import math
import re
from typing import Any, TypeAlias

import yaml

from hgorun.config.paths import at, copy, dotted, walk
from hgorun.config.separators import misread, without_space
from hgorun.errors import ConfigError, KeyPath

Place: TypeAlias = tuple[str, int]

MAX_NODES = 100_000
MAX_DEPTH = 50
TOO_DEEP = f"lists and mappings nested more than {MAX_DEPTH} deep"
_MAX_KEY = 1_000
_MAX_DIGITS = 300  # no float has more than 309; Python's int() refuses more than 4,300
_TIGHT = re.compile(r":[\[{\"']")  # in a key: what begins its value, without a space before it

# What could steer a terminal, or write right to left.
_CONTROL = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
_INTEGER = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


class Builder:
    """Builds the data from the events of a document, on a stack of open lists and mappings."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.positions: dict[KeyPath, Place] = {}
        self.root: list[Any] = []  # the document, once it has begun
        self.open: list[tuple[KeyPath, Any, int | None]] = [((), self.root, None)]  # with the line of a `[` or `{`
        self.key: str | None = None  # what waits for its value in the innermost mapping
        self.nulls: set[KeyPath] = set()
        self.anchors: dict[str, KeyPath] = {}
        self.nodes = 0

    @property
    def bracket(self) -> int | None:
        """The line of the innermost bracket that is open."""
        return self.open[-1][2]

    def take(self, event: yaml.Event) -> None:
        line = event.start_mark.line + 1 if event.start_mark else 1
        tag = getattr(event, "tag", None)
        path, parent, _ = self.open[-1]
        if isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
            self.open.pop()
        elif isinstance(event, yaml.DocumentStartEvent) and self.root:
            raise self.error("a second document (`---`) starts here; a file may hold only one", line)
        elif not isinstance(event, yaml.NodeEvent):
            return
        elif tag is not None:
            raise self.error(f"the tag `{tag}` is refused: values cannot have tags here", line)
        elif isinstance(parent, dict) and self.key is None:
            self.take_key(event, path, parent, line)
        elif parent is self.root:
            if not isinstance(event, yaml.ScalarEvent) or event.style or event.value:
                self.take_value(event, (), parent, line)  # else: comments, to the parser one empty value
        else:
            self.take_value(event, (*path, len(parent) if self.key is None else self.key), parent, line)

    def take_key(self, event: yaml.NodeEvent, path: KeyPath, parent: dict[str, Any], line: int) -> None:
        if event.anchor is not None:
            raise self.error("a key cannot be an anchor or an alias; an anchor stands after the `:`", line, path)
        if not isinstance(event, yaml.ScalarEvent):
            raise self.error("a key is text, not a list or a mapping", line, path)
        key = str(event.value)
        if _CONTROL.search(key) or "\n" in key or "\t" in key or len(key) > _MAX_KEY:
            raise self.error(f"a key has at most {_MAX_KEY} characters, none of them a control character", line, path)
        if not event.style and key in ("", "<<"):
            hint = "`<<` is refused: use `extends: FILE`, or an alias for the whole value"
            raise self.error(hint if key else "there is no key before this `:`", line, path)
        remedy = "" if event.style or not _TIGHT.search(key) else without_space(key)
        if remedy:
            raise self.error(remedy, line, path)
        here = (*path, key)
        if key in parent:
            first = self.positions[here][1]
            lines = f" on line {line}" if first == line else f", on line {first} and on line {line}"
            raise self.error(f"`{key}` is given twice{lines}", line, here)
        self.key = key
        self.positions[here] = self.file, line

    def take_value(self, event: yaml.NodeEvent, here: KeyPath, parent: Any, line: int) -> None:
        value: Any
        if isinstance(event, yaml.AliasEvent):
            value = self.expand(str(event.anchor), here, line)
        else:
            self.count(here, line)
            if event.anchor is not None:
                if event.anchor in self.anchors:
                    raise self.error(f"the anchor `&{event.anchor}` is given twice", line, here)
                self.anchors[event.anchor] = here
            if isinstance(event, yaml.ScalarEvent):
                if not event.style and event.value and _WORDS.get(event.value, "") is None:
                    self.nulls.add(here)
                if bad := _CONTROL.search(event.value):  # from an escape in double quotes
                    raise self.error(f"U+{ord(bad[0]):04X} is not allowed in text", line, here)
                if not event.style and not event.value and self.bracket and (remedy := misread(str(self.key or ""))):
                    raise self.error(f"`{self.key}` has no value: {remedy}", line, here)
                value = event.value if event.style else self.plain(event.value, here, line)
            elif isinstance(event, yaml.CollectionStartEvent):
                value = {} if isinstance(event, yaml.MappingStartEvent) else []
                self.open.append((here, value, line if event.flow_style else None))
        if self.key is None:
            parent.append(value)
            self.positions[here] = self.file, line
        else:
            parent[self.key] = value
            self.key = None

    def expand(self, anchor: str, here: KeyPath, line: int) -> Any:
        """Copy what an anchor names; what is inside keeps the lines of the original."""
        if anchor not in self.anchors:
            message = f"there is no `&{anchor}` above `*{anchor}`; text that starts with `*` needs quotes"
            raise self.error(message, line, here)
        origin = self.anchors[anchor]
        if any(path == origin for path, _, _ in self.open[1:]):
            raise self.error(f"the alias `*{anchor}` is used inside its own anchor", line, here)
        value = at(self.root[0], origin)
        for path, _ in walk(value):
            self.count(here + path, line)
            if path:
                self.positions[here + path] = self.positions[origin + path]
        self.nulls |= {here + null[len(origin) :] for null in self.nulls if null[: len(origin)] == origin}
        return copy(value)

    def plain(self, text: str, here: KeyPath, line: int) -> Any:
        if "\t" in text:
            raise self.error("a tab in text without quotes: use spaces", line, here)
        if text in _WORDS or not _NUMBER.fullmatch(text):
            return _WORDS.get(text, text)
        if len(text) > _MAX_DIGITS:
            raise self.error(f"a number of {len(text)} characters; {_MAX_DIGITS} are the limit", line, here)
        if _INTEGER.fullmatch(text):
            return int(text)
        number = float(re.sub(r"\.(?=[iInN])", "", text))
        if math.isinf(number) and "inf" not in text.lower():
            raise self.error(f"{text} is larger than any number (1.8e308)", line, here)
        return number

    def count(self, here: KeyPath, line: int) -> None:
        self.nodes += 1
        if self.nodes > MAX_NODES:
            message = f"more than {MAX_NODES:,} values, aliases written out: recordings belong in data files"
            raise self.error(message, line)
        if len(here) > MAX_DEPTH:
            raise self.error(TOO_DEEP, line)

    def error(self, message: str, line: int, path: KeyPath = ()) -> ConfigError:
        if len(message) > 300:  # a key, tag or anchor may be as long as the file
            message = message[:297] + "..."
        return ConfigError(message, file=self.file, line=line, key=dotted(path))
