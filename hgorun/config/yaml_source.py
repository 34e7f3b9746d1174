"""YAML text as plain data, together with the file and line of every entry.

The data is built from the events of PyYAML's parser, so no tag can construct anything and every key
is known with its line. Scalars follow the core schema of YAML 1.2 without octal and hexadecimal integers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hgorun.config.kinds import refuse_what_is_no_text
from hgorun.config.nearest import near_file
from hgorun.config.paths import at, naming
from hgorun.config.yaml_builder import MAX_DEPTH, TOO_DEEP, Builder, Place
from hgorun.config.yaml_errors import LINE_BREAK, explain, separated
from hgorun.errors import ConfigError, KeyPath, PluginError, Problem, named_unseen

MAX_BYTES = 2**20
_MAX_BRACKETS = 10 * MAX_DEPTH

# U+0085, U+2028 and U+2029 end a line for YAML but not for editors: with them lines would be miscounted.
_REFUSED = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")
_BRACKETS = re.compile(r"[][{}]")


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
    run : str
        Where this is a run of a file: its name.
    of_run : frozenset
        Paths of what that run says itself.
    """

    data: Any
    positions: dict[KeyPath, Place]
    nulls: frozenset[KeyPath] = frozenset()
    run: str = ""
    of_run: frozenset[KeyPath] = frozenset()

    def where(self, path: KeyPath) -> Place:
        """Return the file and line of ``path``, or of the nearest thing around it."""
        around = (path[:length] for length in range(len(path), -1, -1))
        return next((self.positions[p] for p in around if p in self.positions), ("", 0))

    def key(self, path: KeyPath) -> str:
        """What messages call a key: what a run says itself stands below its name."""
        around = (path[:length] for length in range(len(path), 0, -1))
        own = next((p for p in around if p in self.positions), ()) in self.of_run
        return ".".join(map(str, (*(("runs", self.run) if own else ()), *self.written(path))))

    def told(self, path: KeyPath) -> str:
        """Where something was written and its key, as messages begin: ``file:line: key``, as far as it is known."""
        file, line = self.where(path)
        name = file if file.startswith("--set ") else f"{Path(file).name}:{line}"
        return ": ".join([name] * bool(file) + [self.key(path)])

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

    def _told(self, problem: Problem) -> ConfigError:
        """A problem at a key with its place."""
        file, line = self.where(problem.path)
        return ConfigError(problem.message, file=file, line=line, key=self.key(problem.path))

    @contextmanager
    def located(self) -> Iterator[None]:
        """Turn a problem at a key, or of a class that a block names, into an error that names file, line and key."""
        try:
            yield
        except Problem as problem:
            error = self._told(problem)
            error.add_others(self._told(one) if isinstance(one, Problem) else one for one in problem.others)
            raise error from problem
        except PluginError as error:
            path = naming(self.data, *error.of) if error.of is not None else None
            if path is None or not self.where(path)[0]:
                raise
            raise error.at(self.told(path)) from error.__cause__


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
        raise ConfigError(TOO_DEEP, file=file, line=_line(text, deep))
    builder = Builder(file)
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
