"""What ``hgorun show`` says of a plant, an observer, a kind of noise, a metric or a finding."""

from __future__ import annotations

import inspect
from collections.abc import Container, Iterator, Mapping
from typing import TYPE_CHECKING, TypeAlias, TypedDict, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from hgorun.config.types import Block, pole_text
from hgorun.errors import HgorunError
from hgorun.noise.base import Noise
from hgorun.observers.base import Observer
from hgorun.plants.base import Plant, units_of
from hgorun.result.metrics.base import Metric
from hgorun.tables.layout import reflowed, wrapped

if TYPE_CHECKING:
    from hgorun.analysis.finding import Finding


Record: TypeAlias = dict[str, str | float | None]
"""What is said of a metric or a finding."""


class Key(TypedDict):
    """A key of a block; ``keys`` are those of the mappings that are its values."""

    key: str
    required: bool
    default: object
    range: str
    description: str
    keys: list[Key]


class Quantity(TypedDict, total=False):
    """A parameter, or an input, which has no default."""

    default: float | None
    unit: str
    meaning: str


class Description(TypedDict, total=False):
    """A class that a configuration can name; the keys from ``valid`` on are those of a plant."""

    name: str
    kind: str
    reference: str
    description: str
    keys: list[Key]
    valid: str
    units: Mapping[str, str]
    states: list[str]
    outputs: list[str]
    parameters: dict[str, Quantity]
    inputs: dict[str, Quantity]


def own_doc(cls: type) -> str:
    """The docstring of a class itself: that of a base would describe something else."""
    return inspect.cleandoc(cls.__doc__ or "")


def of_finding(finding: Finding) -> Record:
    return {
        "name": finding.name,
        "kind": "finding",
        "meaning": finding.meaning,
        "unit": finding.unit or "none",
        "shown in": ", ".join(finding.places),
    }


def of_metric(metric: Metric) -> Record:
    return {
        "name": metric.name,
        "kind": "metric",
        "meaning": metric.meaning,
        "unit": {"state": "that of the state", "time": "that of time", "1": "none"}[metric.unit],
        "window": metric.window,
        "best": metric.ideal,
    }


def reference_of(cls: type[Plant] | type[Observer] | type[Noise], keys: Container[str]) -> str:
    """The source of a class, and those of what it does only where its block has a key, of these keys."""
    optional = cls.key_references.items() if issubclass(cls, Observer) else ()
    return "; ".join(filter(None, (cls.reference, *(f"{key}: {source}" for key, source in optional if key in keys))))


def of_class(name: str, kind: str, cls: type[Plant] | type[Observer] | type[Noise]) -> Description:
    found: Description = {
        "name": name,
        "kind": kind,
        "reference": reference_of(cls, cls.model_fields),
        "description": own_doc(cls),
        "keys": keys_of(cls),
    }
    if issubclass(cls, Plant):
        found["valid"] = cls.valid
        needed = {"initial", "inputs"} if cls.known_inputs else {"initial"}
        for key in found["keys"]:
            key["required"] = key["required"] or key["key"] in needed
        found["units"] = units_of(cls)
        found["states"], found["outputs"] = _names(cls)
        found["parameters"] = {
            n: {"default": q.default, "unit": q.unit, "meaning": q.meaning} for n, q in cls.known_parameters.items()
        }
        found["inputs"] = {n: {"unit": q.unit, "meaning": q.meaning} for n, q in cls.known_inputs.items()}
    return found


def _names(cls: type[Plant]) -> tuple[list[str], list[str]]:
    """States and outputs in their order, with the defaults of all keys; empty where they depend on other keys."""
    block = cls.model_construct()
    try:
        return list(block.state_names), list(block.output_names)
    except (HgorunError, AttributeError, TypeError, ValueError):
        return [], []


def keys_of(cls: type[BaseModel]) -> list[Key]:
    """The keys of a block, in their order, but for the one that names its kind."""
    return [_key(name, field) for name, field in cls.model_fields.items() if name != "type"]


def _key(name: str, field: FieldInfo) -> Key:
    """A key with its range and default and, where its values are mappings of known keys, those."""
    limits = [words for item in field.metadata for words in _limits(item)]
    default = None if field.is_required() or field.default_factory is not None else field.default
    return {
        "key": name,
        "required": field.is_required(),
        "default": pole_text(default) if isinstance(default, complex) else default,
        "range": " and ".join(limits),
        "description": field.description or "",
        "keys": [key for block in _blocks(field.annotation) for key in keys_of(block)],
    }


def _limits(item: object) -> Iterator[str]:
    if isinstance(item, Gt):
        yield f"> {item.gt:g}"
    if isinstance(item, Ge):
        yield f">= {item.ge:g}"
    if isinstance(item, Lt):
        yield f"< {item.lt:g}"
    if isinstance(item, Le):
        yield f"<= {item.le:g}"


def _blocks(annotation: object) -> Iterator[type[Block]]:
    """The blocks in a type, such as Term in tuple[Term, ...]."""
    if isinstance(annotation, type) and issubclass(annotation, Block):
        yield annotation
    for part in get_args(annotation):
        yield from _blocks(part)


def as_text(d: Description) -> str:
    lines = [f"{d['name']} ({d['kind']})", *(wrapped(f"source: {d['reference']}") if d["reference"] else [])]
    lines += ["", *reflowed(d["description"])]
    if d.get("valid"):
        lines += ["", *wrapped(f"valid: {d['valid']}")]
    units = {name: f" [{unit}]" for name, unit in d.get("units", {}).items() if unit}
    for group, names in (("states", d.get("states")), ("outputs", d.get("outputs"))):
        if names:
            lines += [
                *([""] if group == "states" else []),
                *wrapped(f"{group}: " + ", ".join(n + units.get(n, "") for n in names)),
            ]
    for group, known in (("parameters", d.get("parameters")), ("inputs", d.get("inputs"))):
        if known:
            lines += ["", f"{group}:"]
            for name, q in known.items():
                value = f" = {q['default']:g}" if q.get("default") is not None else ""
                unit = (f" {q['unit']}" if value else f" [{q['unit']}]") if q["unit"] else ""
                lines += wrapped(f"{name}{value}{unit}  {q['meaning']}", "  ", then="    ")
    lines += ["", "keys:", *_lines(d["keys"], "  ")]
    return "\n".join(lines)


def _lines(keys: list[Key], indent: str) -> Iterator[str]:
    for key in keys:
        if key["required"]:
            value = "required"
        elif key["default"] in (None, ""):
            value = "optional"
        else:
            value = f"default {key['default']}"
        limits = f", {key['range']}" if key["range"] else ""
        told = f"{key['key']} ({value}{limits}): {key['description']}".removesuffix(": ")
        yield from wrapped(told, indent, then=f"{indent}    ")
        yield from _lines(key["keys"], indent + "  ")
