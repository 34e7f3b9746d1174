"""The chosen values as a file: a configuration that gives the page's numbers, in one folder and nowhere else."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hgorun.config.differences import different
from hgorun.config.paths import entries
from hgorun.config.reading import read_source
from hgorun.config.written import with_values
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError, KeyPath, Problem
from hgorun.explore.bench import Bench, Shown
from hgorun.explore.state import State
from hgorun.files import written_whole

_NAME = re.compile(r"[^\W.][\w .=+-]{0,99}\.ya?ml", re.ASCII)
_SUFFIX = ".yaml"


class _Gone(Exception):
    """Something of the file is not in the configuration."""


@dataclass(frozen=True, eq=False)
class Keeper:
    """Writes configurations of a bench.

    Attributes
    ----------
    bench : Bench
    folder : Path
        Nothing is written elsewhere.
    first : str
        What the first file is called unless the page says otherwise.
    alone : bool
        Files extend no other one, as they must where the configuration is part of an installation: elsewhere that
        lies in another place.
    """

    bench: Bench
    folder: Path
    first: str
    alone: bool = False

    def next_name(self) -> str:
        """A name that is still free."""
        stem, number, name = self.first.removesuffix(_SUFFIX), 1, self.first
        while self._taken(self.folder / name):
            number += 1
            name = f"{stem}-{number}{_SUFFIX}"
        return name

    def write(self, shown: Shown, name: str) -> Path:
        """Write what is shown as a new file, whole or not at all.

        It is read again before it takes its name: what it says has to be the same.

        Raises
        ------
        ConfigError
            When the name is not that of a new YAML file in the folder, or the file says something else.
        HgorunError
            When it cannot be written.
        """
        if _NAME.fullmatch(name) is None:
            raise ConfigError(
                f"expected the name of a YAML file, such as {self.first}, without a folder; found {name[:60]!r}"
            )
        target = self.folder / name
        if self._taken(target):
            raise ConfigError(f"{target} exists already, and nothing is overwritten: choose another name")
        text = self.text(shown, target)
        with written_whole(target) as part:
            part.write_text(text, encoding="utf-8")
            self._compare(shown, part)
        return target

    def text(self, shown: Shown, target: Path) -> str:
        """The configuration of a file at some place.

        The file's own text where that is possible, else one that extends it; where an observer is left out, one
        run of several is meant, or the file has to stand alone and does not, everything that decides the numbers.
        """
        try:
            if self.bench.run_name is not None:
                raise _Gone
            before = read_source(self.bench.path)[1].data
            values = {".".join(map(str, place)): value for place, value in _changed(before, shown.said.data)}
        except _Gone:
            return self.bench.text(shown, target)
        text = with_values(self.bench.path, values, target)
        return self.bench.text(shown, target) if self.alone and "extends" in parse(text, str(target)).data else text

    @staticmethod
    def _taken(path: Path) -> bool:
        return path.is_symlink() or path.exists()

    def _compare(self, shown: Shown, part: Path) -> None:
        """Refuse a text that says something else.

        Raises
        ------
        ConfigError
        """
        _, source = read_source(part)
        try:
            same = self.bench.says(source, part) == self.bench.says(shown.said, self.bench.path)
        except Problem as problem:
            raise ConfigError(problem.message) from problem
        if not same:
            raise ConfigError(
                "the text to be written does not give the same configuration, so nothing is written: please report this"
            )


def _changed(before: Any, after: Any) -> Iterator[tuple[KeyPath, Any]]:
    """The values that are others, or new, and where.

    Raises
    ------
    _Gone
        Where something is no longer there.
    """
    for place, value in different(before, after):
        if value is None:
            raise _Gone
        yield from _leaves(value, place)


def _leaves(part: Any, place: KeyPath) -> Iterator[tuple[KeyPath, Any]]:
    """The values of a part: those inside a mapping each."""
    if isinstance(part, dict) and part:
        for key, inner in entries(part):
            yield from _leaves(inner, (*place, key))
    else:
        yield place, part


def command(bench: Bench, state: State) -> str:
    """What opens the same page with these values in the file's place; observers are left out on the page."""
    words = ["hgorun", "explore", str(bench.path)]
    if bench.run_name is not None:
        words += ["--run", bench.run_name]
    changes = State(state.values).changes(bench.knobs)
    words += [part for path, value in changes.items() for part in ("--set", f"{path}={_as_set(value)}")]
    return shlex.join(words)


def _as_set(value: Any) -> str:
    """A value as ``--set`` reads it."""
    if isinstance(value, list):
        return "[" + ", ".join(map(_as_set, value)) + "]"
    return "'" + value.replace("'", "''") + "'" if isinstance(value, str) else repr(value)
