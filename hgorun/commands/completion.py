"""What a shell completes: names of what there is, files of the kind that a command takes, keys of a configuration.

Only the standard library and typer are imported here, since every command reads it; the rest when Tab is pressed.
Whatever cannot be read has no completions: a shell is not the place for messages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_origin

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel

_CONFIGURATIONS, _RESULTS, _LOGS = (".yaml", ".yml"), (".h5", ".nc", ".hdf5"), (".csv", ".txt", ".tsv", ".parquet")


def one_of(*words: str) -> Callable[[str], list[str]]:
    """Completion of a word out of a few."""

    def complete(incomplete: str) -> list[str]:
        return _matching(words, incomplete)

    return complete


def configurations(incomplete: str) -> list[str]:
    """YAML files, and the experiments that hgorun brings."""
    return [*_files(incomplete, _CONFIGURATIONS), *experiments(incomplete)]


def yaml_files(incomplete: str) -> list[str]:
    return _files(incomplete, _CONFIGURATIONS)


def results(incomplete: str) -> list[str]:
    return _files(incomplete, _RESULTS)


def sources(incomplete: str) -> list[str]:
    """What is compared: results and configurations."""
    return [*results(incomplete), *configurations(incomplete)]


def logs(incomplete: str) -> list[str]:
    return _files(incomplete, (*_LOGS, *_RESULTS))


def experiments(incomplete: str) -> list[str]:
    """The experiments that hgorun brings, by their short names."""
    from hgorun.reproduce.shipped import experiments

    return _matching([Path(name).name for name in experiments()], incomplete)


def starts(incomplete: str) -> list[str]:
    """What ``init`` copies: experiments and examples."""
    from hgorun.reproduce.shipped import examples

    return [*experiments(incomplete), *_matching(examples(), incomplete)]


def publications(incomplete: str) -> list[str]:
    """What has figures and claims: files, experiments and the folders that they are in."""
    from hgorun.reproduce.shipped import experiments as shipped

    return [*_matching({Path(name).parts[0] for name in shipped()}, incomplete), *configurations(incomplete)]


def plants(incomplete: str) -> list[str]:
    from hgorun.plants.base import PLANTS

    return _matching(PLANTS.names(), incomplete)


def observers(incomplete: str) -> list[str]:
    from hgorun.observers.base import OBSERVERS

    return _matching(OBSERVERS.names(), incomplete)


def metrics(incomplete: str) -> list[str]:
    from hgorun.result.metrics.base import all_metrics

    return _matching(all_metrics(closed=True), incomplete)


def everything(incomplete: str) -> list[str]:
    """What ``show`` describes."""
    from hgorun.analysis.finding import FINDINGS
    from hgorun.noise.base import NOISE

    named = _matching([*NOISE.names(), *FINDINGS.names()], incomplete)
    return [
        *plants(incomplete),
        *observers(incomplete),
        *named,
        *metrics(incomplete),
        *experiments(incomplete),
    ]


def runs(ctx: typer.Context, incomplete: str) -> list[str]:
    """The runs of the configuration that stands on the line."""
    found = _data(ctx).get("runs", {})
    return _matching(found, incomplete) if isinstance(found, dict) else []


def labels(ctx: typer.Context, incomplete: str) -> list[str]:
    """The observers of the configuration that stands on the line."""
    found = _data(ctx).get("observers", {})
    return _matching(found, incomplete) if isinstance(found, dict) else []


def keys(ctx: typer.Context, incomplete: str) -> list[str]:
    """``path=`` of every key for ``--set``: those in the configuration on the line, and those that it leaves out."""
    data = _data(ctx)
    found = dict.fromkeys([*_written(data), *_known(data)])
    return _matching((f"{path}=" for path in found), incomplete)


def _written(data: dict[str, Any]) -> Iterator[str]:
    """Paths of what is in a configuration and holds nothing else."""
    from hgorun.config.paths import dotted, walk

    for path, value in walk(data):
        if path and not isinstance(value, (dict, list)) and path[0] not in ("figures", "claims"):
            yield dotted(path) or ""


def _known(data: dict[str, Any]) -> Iterator[str]:
    """Paths of the keys that the blocks of a configuration may have."""
    from hgorun.config.models import Metrics, Solver, Time
    from hgorun.measurement.blocks import Measurement
    from hgorun.observers.base import OBSERVERS
    from hgorun.plants.base import PLANTS
    from hgorun.plants.inline import InlinePlant

    yield "seed"
    for name, block in (("time", Time), ("solver", Solver), ("metrics", Metrics), ("measurement", Measurement)):
        yield from _fields(name, block)
    with suppress(KeyError):
        plant = _type_of(data.get("plant"))
        yield from _fields("plant", PLANTS.find(plant) if plant else InlinePlant)
    written = data.get("observers")
    for label, block in written.items() if isinstance(written, dict) else ():
        with suppress(KeyError):
            yield from _fields(f"observers.{label}", OBSERVERS.find(_type_of(block)))


def _type_of(block: object) -> str:
    return str(block.get("type", "")) if isinstance(block, dict) else ""


def _fields(prefix: str, block: type[BaseModel]) -> Iterator[str]:
    """Paths of a block's keys, and of those of the blocks in it."""
    for name, field in block.model_fields.items():
        inner = list(_blocks(field.annotation))
        for one in inner:
            yield from _fields(f"{prefix}.{name}", one)
        if not inner and name != "type":
            yield f"{prefix}.{name}"


def _blocks(annotation: object) -> Iterator[type[BaseModel]]:
    """The blocks that a key's value may be; not those in lists, whose items have numbers."""
    from hgorun.config.types import Block

    if isinstance(annotation, type) and issubclass(annotation, Block):
        yield annotation
    elif get_origin(annotation) not in (list, tuple, dict):
        for part in get_args(annotation):
            yield from _blocks(part)


def _data(ctx: typer.Context) -> dict[str, Any]:
    """The configuration that stands on the line, with what it extends; nothing where it cannot be read."""
    from hgorun.config.reading import read_source
    from hgorun.errors import HgorunError
    from hgorun.reproduce.shipped import found

    # of arguments that take several values, those given so far are not yet values
    given = [ctx.params.get("config"), ctx.params.get("file"), *ctx.args]
    for path in given:
        if path is not None:
            with suppress(HgorunError, OSError, ValueError):
                _, source = read_source(found(Path(str(path))))
                return source.data if isinstance(source.data, dict) else {}
    return {}


def _files(incomplete: str, suffixes: Iterable[str]) -> list[str]:
    """Files of some kinds, and folders, that begin like this."""
    folder, _, start = incomplete.rpartition("/")
    place = Path(f"{folder}/") if folder or incomplete.startswith("/") else Path()
    names = []
    with suppress(OSError):
        for path in sorted(place.iterdir()):
            if path.name.startswith(start) and not (path.name.startswith(".") and not start):
                shown = incomplete[: len(incomplete) - len(start)] + path.name
                if path.is_dir():
                    names.append(f"{shown}/")
                elif path.suffix.lower() in suffixes:
                    names.append(shown)
    return names


def _matching(names: Iterable[str], incomplete: str) -> list[str]:
    return sorted(name for name in names if name.startswith(incomplete))
