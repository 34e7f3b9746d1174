"""The ``runs:`` of a file: each is the rest of the file with its own changes merged into it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hgorun.config.models import File
from hgorun.config.nearest import nearest
from hgorun.config.overrides import merge
from hgorun.config.refusals import Refusals
from hgorun.config.study import Ensemble
from hgorun.config.types import SEEDS, describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError

OF_THE_FILE = ("runs", "figures", "claims", "tune")  # what is not part of one run
OF_THE_ENSEMBLE = ("seeds", "vary")
_MOST_MEMBERS = 1_000_000  # of a run
_OF_A_RUN = tuple(key for key in (*File.model_fields, *OF_THE_ENSEMBLE) if key not in ("extends", *OF_THE_FILE))


def split(source: Source) -> dict[str, tuple[Source, dict[str, Any]]]:
    """The runs of a file: {name: (configuration, keys that make an ensemble of it)}.

    Raises
    ------
    ConfigError
        When ``runs`` is not a mapping of names to mappings, or one of them has a key that no run has.
    """
    faults = Refusals()
    found = parts(source, faults)
    faults.refuse()
    return found


def parts(source: Source, faults: Refusals) -> dict[str, tuple[Source, dict[str, Any]]]:
    """The same of what has no faults, and of runs without the keys that no run has.

    Parameters
    ----------
    source : Source
    faults : Refusals
        Gets what is wrong.
    """
    shared = _without(source, (), OF_THE_FILE)
    found: dict[str, tuple[Source, dict[str, Any]]] = {}
    runs: dict[str, Any] = {}
    with faults.of_a_part():
        runs = _mapping(source, ("runs",))
    for name in runs:
        path = ("runs", name)
        with faults.of_a_part():
            override = _mapping(source, path)
            if not name or name.startswith(".") or any(c in "/\\." or not c.isprintable() for c in name):
                raise _error(source, path, "a run's name is the name of its file: no `.`, no / or \\")
            refused = [key for key in override if key not in _OF_A_RUN]
            for key in refused:
                with faults.of_a_part():
                    raise _refused(source, path, key)
            ensemble = {key: override[key] for key in OF_THE_ENSEMBLE if key in override}
            own = _without(source, path, (*OF_THE_ENSEMBLE, *refused))
            of_run = frozenset(place for place in own.positions if place)
            found[name] = replace(merge(shared, own), run=name, of_run=of_run), ensemble
    return found


def _refused(source: Source, path: tuple[str, ...], key: str) -> ConfigError:
    """Why a run does not have a key."""
    if key in ("extends", *OF_THE_FILE):
        return _error(source, (*path, key), f"{key} belongs to the file, not to one of its runs")
    known = f"Known here: {', '.join(_OF_A_RUN)}"
    return _error(source, (*path, key), f"unknown key {key!r}.{nearest(str(key), _OF_A_RUN)} {known}")


def check_ensemble(ensemble: Ensemble, own: Source, source: Source, run: str) -> None:
    """Refuse seeds that lie above the largest one or are varied as well, and more members than can be asked for.

    Raises
    ------
    ConfigError
    """

    def wrong(what: str, *key: str) -> ConfigError:
        file, line = source.where(("runs", run, *key))
        return ConfigError(what, file=file, line=line, key=".".join(("runs", run, *key)))

    first, seeds, vary = own.data.get("seed", 0), ensemble.seeds, ensemble.vary
    if seeds is None:
        return
    if isinstance(first, int) and first + seeds > SEEDS:
        raise wrong(f"{seeds} seeds from {first} on end above the largest seed, {SEEDS - 1}", "seeds")
    if vary is None:
        return
    if "seed" in vary.set:
        raise wrong("seeds counts the seeds already: let one of them set seed", "vary", "set", "seed")
    if len(vary.values) * seeds > _MOST_MEMBERS:
        what = f"{len(vary.values)} values with {seeds} seeds make more than {_MOST_MEMBERS} members"
        raise wrong(f"{what}; a sweep file may have more", "seeds")


def _mapping(source: Source, path: tuple[str, ...]) -> dict[str, Any]:
    value = source.data
    for key in path:
        value = value[key]
    if not isinstance(value, dict) or (len(path) == 1 and not value):
        what = "names of runs and what each changes" if len(path) == 1 else "what the run changes, {} for nothing"
        raise _error(source, path, f"expected a mapping, {what}; found {describe(value)}")
    return value


def _without(source: Source, path: tuple[str, ...], keys: tuple[str, ...]) -> Source:
    """The mapping at a path as a source of its own, without some of its keys."""
    value = source.data
    for key in path:
        value = value[key]
    depth = len(path)
    places = {
        place[depth:]: where
        for place, where in source.positions.items()
        if place[:depth] == path and (len(place) == depth or place[depth] not in keys)
    }
    return Source({key: part for key, part in value.items() if key not in keys}, places, source.nulls_below(path))


def _error(source: Source, path: tuple[str, ...], message: str) -> ConfigError:
    file, line = source.where(path)
    return ConfigError(message, file=file, line=line, key=".".join(path))
