"""What ``--set`` and ``--seed`` do not change, because runs of the file have the key themselves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hgorun.config.overrides import places_set, set_path
from hgorun.config.paths import dotted, entries
from hgorun.config.reading import read_source
from hgorun.config.shell import assigned
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath
from hgorun.study.split import OF_THE_FILE, split

_MOST = 6  # runs in a sentence


def kept_by_runs(path: Path, overrides: Sequence[str], seed: int | None, run: str | None) -> Iterator[str]:
    """Sentences about assignments that do not change some of the runs.

    Parameters
    ----------
    path : Path
        Of a configuration in which nothing is wrong after the changes.
    overrides, seed
        What is changed.
    run : str or None
        The only run that is carried out, if one is named.

    Yields
    ------
    str
        For each assignment one about runs that have the key, and one about runs that vary it.
    """
    _, source = read_source(path)
    if not isinstance(source.data, dict) or "runs" not in source.data:
        return
    assignments = {f"--set {one}": one for one in overrides} | (
        {} if seed is None else {f"--seed {seed}": f"seed={seed}"}
    )
    made: list[tuple[str, KeyPath, str]] = []
    for option, assignment in assignments.items():
        made += [(option, *one) for one in places_set(source.data, assignment)]
        source = set_path(source, assignment)
    runs = {name: found for name, found in split(source).items() if run in (None, name)}
    for option, place, text in made:
        if place[0] in ("runs", *OF_THE_FILE):
            continue
        keeping: dict[KeyPath, list[str]] = defaultdict(list)
        for name, (found, _) in runs.items():
            if _value(found.data, place) != _value(source.data, place):
                keeping[_own(source, name, place)].append(name)
        for own, names in keeping.items():
            if own:
                right = f"; `{assigned(('runs', names[0], *place), text)}` changes it" if own == place else ""
                which, have, itself = _told(names, "has", "have")
                yield f"{option}: {which} {have} the key {dotted(own)} {itself}, which stays as it is{right}"
        if varying := [name for name, (_, ensemble) in runs.items() if _varies(ensemble, place)]:
            which, vary, _ = _told(varying, "varies", "vary")
            yield f"{option}: {which} {vary} {dotted(place)}, whose values stay as they are"


def _value(data: Any, path: KeyPath) -> Any:
    """What is at a path, or None."""
    for key in path:
        data = dict(entries(data)).get(key)
    return data


def _own(source: Source, run: str, place: KeyPath) -> KeyPath:
    """What a run itself says of a key: the key, or the part of the path that it replaces; empty where it says nothing.

    An observer that it leaves out, or of another type, has other keys.
    """
    block, path = source.data["runs"][run], ("runs", run, *place)
    for length, key in enumerate(place):
        below = dict(entries(block))
        if key not in below:
            replaced = block is not None and not isinstance(block, dict)
            return place[:length] if replaced else ()
        block = below[key]
    file, _ = source.where(path)
    return () if file.startswith("--set ") else place


def _varies(ensemble: Mapping[str, Any], place: KeyPath) -> bool:
    """Whether the members of a run have values of their own there."""
    varied = (ensemble.get("vary") or {}).get("set") or {}
    parts = [str(part) for part in place]
    return any(path.split(".")[: len(parts)] == parts for path in varied)


def _told(names: Sequence[str], one: str, several: str) -> tuple[str, str, str]:
    """Runs as a subject, its verb, and its pronoun."""
    if len(names) == 1:
        return f"the run {names[0]}", one, "itself"
    more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
    return f"the runs {', '.join(names[:_MOST])}{more}", several, "themselves"
