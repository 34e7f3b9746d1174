"""YAML text as plain data, together with the file and line of every entry.

The data is built from the events of PyYAML's parser, so no tag can construct anything and every key
is known with its line. Scalars follow the core schema of YAML 1.2 without octal and hexadecimal integers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from hgorun.config.kinds import refuse_what_is_no_text
from hgorun.config.nearest import near_file
from hgorun.config.paths import at, copy, dotted, walk
from hgorun.config.separators import misread, without_space
from hgorun.config.yaml_errors import LINE_BREAK, explain, separated
from hgorun.errors import ConfigError, KeyPath, Problem, named_unseen

Place: TypeAlias = tuple[str, int]

MAX_BYTES = 2**20
MAX_NODES = 100_000
MAX_DEPTH = 50
_MAX_KEY = 1_000
_TIGHT = re.compile(r":[\[{\"']")  # in a key: what begins its value, without a space before it
_TOO_DEEP = f"lists and mappings nested more than {MAX_DEPTH} deep"
_MAX_BRACKETS = 10 * MAX_DEPTH
_MAX_DIGITS = 300  # no float has more than 309; Python's int() refuses more than 4,300

# U+0085, U+2028 and U+2029 end a line for YAML but not for editors: with them lines would be miscounted.
_REFUSED = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")
# What could steer a terminal, or write right to left.
_CONTROL = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
_BRACKETS = re.compile(r"[][{}]")
_INTEGER = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


class _PythonLoader(yaml.BaseLoader):
    """PyYAML's own parser with libyaml's rule for tabs: they may separate, not indent."""

    def scan_to_next_token(self) -> None:
        super().scan_to_next_token()
        while self.peek() == "\t" and (self.flow_level or not self.allow_simple_key):
            self.forward()
            super().scan_to_next_token()


# libyaml is ten times as fast; PyYAML's wheels have it, a build from source may not.
_LOADER: Any = getattr(yaml, "CBaseLoader", _PythonLoader)


@dataclass(frozen=True)
class Source:
    """Plain data and where each part of it was written.

    Parameters
    ----------
    data : Any
        Dictionaries with text keys, lists, text, numbers, booleans and None; not to be modified.
    positions : dict
        Path, such as ``("observers", "SHGO", "theta")``, to (file, line): of an entry of a mapping, the
        line of its key.
    nulls : frozenset
        Paths of keys whose value is written as ``null`` or ``~``, other than nothing at all: where the key is
        inherited, it is to be removed.
    """

    data: Any
    positions: dict[KeyPath, Place]
    nulls: frozenset[KeyPath] = frozenset()

    def where(self, path: KeyPath) -> Place:
        """Return the file and line of ``path``, or of the nearest thing around it."""
        around = (path[:length] for length in range(len(path), -1, -1))
        return next((self.positions[p] for p in around if p in self.positions), ("", 0))

    def told(self, path: KeyPath) -> str:
        """Where something was written and its key, as messages begin: ``file:line: key``, as far as it is known."""
        file, line = self.where(path)
        name = file if file.startswith("--set ") else f"{Path(file).name}:{line}"
        return ": ".join([name] * bool(file) + [dotted(path) or ""])

    def written(self, path: KeyPath) -> KeyPath:
        """The path as far as it is a mapping's or a list's: what is below a single value stands at its key."""
        part = self.data
        for length, key in enumerate(path):
            if isinstance(part, dict):
                part = part.get(key)
            elif isinstance(part, (list, tuple)) and isinstance(key, int) and key < len(part):
                part = part[key]
            elif part is None:
                return path
            else:
                return path[:length]
        return path

    def below(self, path: KeyPath) -> Source:
        """The part at a path as a source of its own."""
        places = {place[len(path) :]: where for place, where in self.positions.items() if place[: len(path)] == path}
        return Source(at(self.data, path), places, self.nulls_below(path))

    def nulls_below(self, path: KeyPath) -> frozenset[KeyPath]:
        """Those of the part at a path, as that part has them."""
        return frozenset(null[len(path) :] for null in self.nulls if null[: len(path)] == path)

    @contextmanager
    def located(self) -> Iterator[None]:
        """Turn a problem at a key into an error that names file, line and key."""
        try:
            yield
        except Problem as problem:
            file, line = self.where(problem.path)
            key = ".".join(map(str, self.written(problem.path)))
            raise ConfigError(problem.message, file=file, line=line, key=key) from problem


def read(path: Path) -> tuple[str, Source]:
    """Read a YAML file: its text, verbatim, and what it says.

    Raises
    ------
    ConfigError
        The file is missing, unreadable, of another kind, larger than 1 MiB, not UTF-8, or not what `parse` takes.
    """
    file = str(path)
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        refuse_what_is_no_text(content, path)
        if len(content) > MAX_BYTES:
            raise ConfigError("larger than 1 MiB: recordings belong in data files", file=file)
        text = content.decode("utf-8")
    except FileNotFoundError:
        raise ConfigError(f"there is no such file{near_file(path)}", file=file) from None
    except IsADirectoryError:
        raise ConfigError("this is a folder; a YAML file was expected", file=file) from None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        message = f"byte 0x{content[error.start]:02x} is not UTF-8: save the file as UTF-8"
        raise ConfigError(message, file=file, line=line) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"cannot be read: {reason}", file=file) from error
    return text, parse(text, file)


def parse(text: str, file: str) -> Source:
    """Turn YAML text into a `Source`; ``file`` is the name that positions and messages carry.

    Raises
    ------
    ConfigError
        The text is empty, not YAML, or uses what is refused: tags, merge keys, several documents, duplicate
        keys, keys that are not scalars, control characters, aliases inside their anchors, more than 100,000
        values (aliases written out) or more than 50 levels.
    """
    text = text.removeprefix("\ufeff")
    if bad := _REFUSED.search(text):
        raise ConfigError(f"U+{ord(bad[0]):04X} is not allowed in YAML", file=file, line=_line(text, bad.start()))
    if (deep := _too_deep(text)) is not None:
        raise ConfigError(_TOO_DEEP, file=file, line=_line(text, deep))
    builder = _Builder(file)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.YAMLError as error:
        sentence, line = explain(error, text, builder.bracket)
        sentence, line = separated(sentence, line, text)
        for number in (line, line - 1):  # a line that only looks indented is noticed at the next one
            if number and (told := named_unseen(LINE_BREAK.split(text)[number - 1])):
                raise ConfigError(f"{sentence}; {told}", file=file, line=number) from error
        raise ConfigError(sentence, file=file, line=line) from error
    if not builder.root:
        raise ConfigError("the file is empty; `hgorun init` copies an example to start from", file=file)
    return Source(builder.root[0], builder.positions, frozenset(builder.nulls))


def _line(text: str, index: int) -> int:
    return len(LINE_BREAK.findall(text, 0, index)) + 1


def _too_deep(text: str) -> int | None:
    """The place of an opening bracket inside too many others, if there is one.

    The parsers look many brackets ahead of the events that the builder counts: libyaml refuses a thousand of them in
    words of its own (0.2.6) or takes minutes for them (0.2.5). Brackets in quotes and comments are counted too, so
    this bound is far above the builder's.
    """
    depth = 0
    for match in _BRACKETS.finditer(text):
        depth = depth + 1 if match[0] in "[{" else max(depth - 1, 0)
        if depth > _MAX_BRACKETS:
            return match.start()
    return None


class _Builder:
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
            raise self.error(_TOO_DEEP, line)

    def error(self, message: str, line: int, path: KeyPath = ()) -> ConfigError:
        if len(message) > 300:  # a key, tag or anchor may be as long as the file
            message = message[:297] + "..."
        return ConfigError(message, file=self.file, line=line, key=dotted(path))
