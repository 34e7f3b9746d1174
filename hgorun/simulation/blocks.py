"""The parts of a configuration checked against the classes that they name."""

from __future__ import annotations

from typing import Any, TypeVar

from hgorun.config.expressions import nearest
from hgorun.config.models import Experiment as Blocks
from hgorun.config.types import describe
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.measurement.blocks import Measurement
from hgorun.observers.base import OBSERVERS, AnyObserver
from hgorun.plants.base import PLANTS, Plant
from hgorun.plants.inline import InlinePlant
from hgorun.registry import Registry

T = TypeVar("T")


def check(source: Source) -> tuple[Blocks, Plant, Measurement, dict[str, AnyObserver]]:
    """The blocks of a configuration, its plant, its measurement and its observers.

    Raises
    ------
    ConfigError
        For the first thing wrong: file, line, key, what was found and what would be right.
    """
    blocks = validate(Blocks, source.data, source, ())
    plant = _plant(blocks, source)
    measurement = validate(Measurement, blocks.measurement, source, ("measurement",))
    return (
        blocks,
        plant,
        measurement,
        {label: _observer(label, block, source) for label, block in blocks.observers.items()},
    )


def _plant(blocks: Blocks, source: Source) -> Plant:
    block = blocks.plant
    if "type" not in block or block["type"] == "inline":
        if "states" not in block and "dynamics" not in block:
            file, line = source.where(("plant",))
            known = ", ".join(PLANTS.names())
            raise ConfigError(
                f"expected type (one of {known}) or a model: states, dynamics, output",
                file=file,
                line=line,
                key="plant",
            )
        return validate(InlinePlant, block, source, ("plant",))
    cls = _find(PLANTS, block["type"], source, ("plant", "type"))
    return validate(cls, block, source, ("plant",))


def _observer(label: str, block: dict[str, Any], source: Source) -> AnyObserver:
    path = ("observers", label)
    file, line = source.where(path)
    if not label or "/" in label or "." in label:
        raise ConfigError(
            "an observer's label must not be empty and has no / and no . in it",
            file=file,
            line=line,
            key=f"observers.{label}",
        )
    if "type" not in block:
        known = ", ".join(OBSERVERS.names())
        others = [name for name in source.data["observers"] if name != label]
        raise ConfigError(
            f"type is missing.{nearest(label, others)} It is one of {known}",
            file=file,
            line=line,
            key=f"observers.{label}",
        )
    cls = _find(OBSERVERS, block["type"], source, (*path, "type"))
    return validate(cls, block, source, path)


def _find(registry: Registry[T], name: Any, source: Source, path: tuple[str, ...]) -> T:
    try:
        return registry.find(str(name))
    except KeyError:
        file, line = source.where(path)
        known = registry.names()
        raise ConfigError(
            f"no {registry.kind} is called {describe(name)}.{nearest(str(name), known)} Known: {', '.join(known)}",
            file=file,
            line=line,
            key=".".join(path),
        ) from None
