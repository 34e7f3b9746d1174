"""``list``, ``show``, ``schema``, ``init``: what there is and how to start."""

from __future__ import annotations

import inspect
import json as json_text
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from hgorun.commands.options import Init, List, Show
from hgorun.config import yaml_source
from hgorun.config.expressions import nearest
from hgorun.config.models import File
from hgorun.config.types import pole_text
from hgorun.errors import ConfigError, HgorunError
from hgorun.figures.scaling import quantities
from hgorun.files import write_text
from hgorun.measurement.blocks import Measurement
from hgorun.noise.base import NOISE, Noise
from hgorun.observers.base import OBSERVERS, Observer
from hgorun.plants.base import PLANTS, Plant, units_of
from hgorun.plants.inline import InlinePlant
from hgorun.registry import Registry
from hgorun.reproduce.shipped import experiments
from hgorun.result.metrics.base import Metric, all_metrics

if TYPE_CHECKING:
    from hgorun.analysis.finding import Finding

_REGISTRIES: dict[str, Registry[Any]] = {"plants": PLANTS, "observers": OBSERVERS, "noise": NOISE}
_KINDS = (*_REGISTRIES, "metrics", "findings", "experiments")


def _first_line(cls: type) -> str:
    return (inspect.getdoc(cls) or "").split("\n\n")[0].replace("\n", " ")


def _titles() -> dict[str, str]:
    found = {}
    for name, path in experiments().items():
        _, source = yaml_source.read(path)
        found[name] = str(source.data.get("title", "")) if isinstance(source.data, dict) else ""
    return found


def _entries(kind: str) -> dict[str, str]:
    """Name: one line, of all things of a kind."""
    if kind == "experiments":
        return _titles()
    if kind == "findings":
        return {name: finding.meaning for name, finding in _findings().items()}
    if kind == "metrics":
        return {name: metric.meaning for name, metric in all_metrics().items()}
    return {name: _first_line(cls) for name, cls in _REGISTRIES[kind].all().items()}


def list_all(options: List) -> int:
    """Names and one line each."""
    kind = options.kind
    if kind not in (*_KINDS, "all"):
        raise ConfigError(f"expected one of {', '.join(_KINDS)}, all; found {kind!r}.{nearest(kind, _KINDS)}")
    found = {k: _entries(k) for k in _KINDS if kind in (k, "all")}
    if options.json:
        print(json_text.dumps(found, indent=2))
        return 0
    width = max(len(name) for entries in found.values() for name in entries)
    for k, entries in found.items():
        print(f"{k}:")
        for name, line in entries.items():
            print(f"  {name:<{width}}  {line}".rstrip())
    return 0


def show(options: Show) -> int:
    """Everything about one entry."""
    name, json = options.name, options.json
    for registry in _REGISTRIES.values():
        classes = registry.all()
        if name in classes:
            described = _described(name, registry.kind, classes[name])
            print(json_text.dumps(described, indent=2) if json else _as_text(described))
            return 0
    metrics = all_metrics()
    if name in metrics:
        described = _metric(metrics[name])
        print(json_text.dumps(described, indent=2) if json else "\n".join(f"{k}: {v}" for k, v in described.items()))
        return 0
    findings = _findings()
    if name in findings:
        described = _finding(findings[name])
        print(json_text.dumps(described, indent=2) if json else "\n".join(f"{k}: {v}" for k, v in described.items()))
        return 0
    shipped = experiments()
    for path, file in shipped.items():
        if name in (path, Path(path).name):
            text = file.read_text(encoding="utf-8")
            print(json_text.dumps({"name": path, "kind": "experiment", "text": text}) if json else text)
            return 0
    known = [*(name for registry in _REGISTRIES.values() for name in registry.names()), *metrics, *findings, *shipped]
    raise ConfigError(f"nothing is called {name!r}.{nearest(name, known)} See hgorun list")


def _findings() -> dict[str, Finding]:
    from hgorun.analysis.finding import all_findings  # with all of the analysis, which nothing else here needs

    return {finding.name: finding for finding in all_findings()}


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "kind": "finding",
        "meaning": finding.meaning,
        "unit": finding.unit or "none",
        "shown in": ", ".join(finding.places),
    }


def _metric(metric: Metric) -> dict[str, Any]:
    return {
        "name": metric.name,
        "kind": "metric",
        "meaning": metric.meaning,
        "unit": {"state": "that of the state", "time": "that of time", "1": "none"}[metric.unit],
        "window": metric.window,
        "best": metric.ideal,
    }


def _described(name: str, kind: str, cls: type[Plant] | type[Observer] | type[Noise]) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": name,
        "kind": kind,
        "reference": cls.reference,
        "description": inspect.getdoc(cls) or "",
        "keys": [_key(key, field) for key, field in cls.model_fields.items() if key != "type"],
    }
    if issubclass(cls, Plant):
        found["valid"] = cls.valid
        needed = {"initial", "inputs"} if cls.known_inputs else {"initial"}
        for key in found["keys"]:
            key["required"] = key["required"] or key["key"] in needed
        found["units"] = units_of(cls)
        found["parameters"] = {
            n: {"default": q.default, "unit": q.unit, "meaning": q.meaning} for n, q in cls.known_parameters.items()
        }
        found["inputs"] = {n: {"unit": q.unit, "meaning": q.meaning} for n, q in cls.known_inputs.items()}
    return found


def _key(name: str, field: FieldInfo) -> dict[str, Any]:
    limits = []
    for item in field.metadata:
        for attribute, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            if getattr(item, attribute, None) is not None:
                limits.append(f"{sign} {getattr(item, attribute):g}")
    default = None if field.is_required() or field.default_factory is not None else field.default
    return {
        "key": name,
        "required": field.is_required(),
        "default": pole_text(default) if isinstance(default, complex) else default,
        "range": " and ".join(limits),
        "description": field.description or "",
    }


def _as_text(d: dict[str, Any]) -> str:
    lines = [f"{d['name']} ({d['kind']})", f"source: {d['reference']}", "", d["description"]]
    if d.get("valid"):
        lines += ["", f"valid: {d['valid']}"]
    if d.get("units"):
        lines += ["", "states: " + ", ".join(f"{name} [{unit}]" for name, unit in d["units"].items())]
    for group in ("parameters", "inputs"):
        if d.get(group):
            lines += ["", f"{group}:"]
            for name, q in d[group].items():
                value = f" = {q['default']:g}" if q.get("default") is not None else ""
                lines.append(f"  {name}{value} {q['unit']}  {q['meaning']}".rstrip())
    lines += ["", "keys:"]
    for key in d["keys"]:
        if key["required"]:
            value = "required"
        elif key["default"] in (None, ""):
            value = "optional"
        else:
            value = f"default {key['default']}"
        limits = f", {key['range']}" if key["range"] else ""
        lines.append(f"  {key['key']} ({value}{limits}): {key['description']}")
    return "\n".join(lines)


def schema() -> int:
    """The JSON schema, with the keys of every plant, observer and kind of noise."""
    print(json_text.dumps(build_schema(), indent=2))
    return 0


def build_schema() -> dict[str, Any]:
    """The schema as data."""
    top = File.model_json_schema()
    definitions = top.setdefault("$defs", {})

    def add(model: type[BaseModel], name: str, constant: str | None = None, *, whole: bool = False) -> dict[str, str]:
        own = model.model_json_schema(ref_template="#/$defs/{model}")
        definitions.update(own.pop("$defs", {}))
        if not whole:  # a file that extends another one may leave anything out, except in the items of a list
            own.pop("required", None)
        if constant is not None:
            own["properties"]["type"] = {"const": constant}
        definitions[name] = own
        return {"$ref": f"#/$defs/{name}"}

    plants = [add(cls, f"plant-{name}", name) for name, cls in PLANTS.all().items()]
    observers = [add(cls, f"observer-{name}", name) for name, cls in OBSERVERS.all().items()]
    top["properties"]["plant"] = {"anyOf": [*plants, add(InlinePlant, "plant-inline", "inline")]}
    definitions["plant-inline"]["properties"]["output"] = {
        "anyOf": [
            {"type": "string"},
            {"type": "array", "items": {"type": "string"}},
            definitions["plant-inline"]["properties"]["output"],
        ]
    }
    top["properties"]["observers"]["additionalProperties"] = {"anyOf": observers}
    top["properties"]["measurement"] = add(Measurement, "Measurement")
    definitions["Scaling"]["properties"]["of"]["examples"] = list(quantities())
    definitions["Noise"] = {"anyOf": [add(cls, f"noise-{name}", name, whole=True) for name, cls in NOISE.all().items()]}
    top.pop("required", None)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **top}


def init(options: Init) -> int:
    """Copy an experiment and the files that it extends."""
    name, folder = options.name, options.folder
    shipped = experiments()
    matches = [file for path, file in shipped.items() if name in (path, Path(path).name)]
    if not matches:
        raise ConfigError(
            f"no experiment is called {name!r}.{nearest(name, [*shipped, *(Path(p).name for p in shipped)])}"
        )
    copies = [(folder / file.name, text) for file, text in _with_bases(matches[0])]
    for target, text in copies:
        if target.exists() and not options.force and target.read_text(encoding="utf-8") != text:
            raise HgorunError(f"{target} exists and differs; --force overwrites it")
    for target, text in copies:
        write_text(target, text)
        print(f"written: {target}")
    print(f"try: hgorun simulate {folder / matches[0].name}")
    return 0


def _with_bases(file: Path) -> Iterator[tuple[Path, str]]:
    """A file and those that it extends, with texts in which all of them lie in one folder."""
    text, source = yaml_source.read(file)
    base = source.data.get("extends") if isinstance(source.data, dict) else None
    if isinstance(base, str):
        yield from _with_bases(file.parent / base)
        lines = text.splitlines(keepends=True)
        place = source.positions["extends",][1] - 1
        lines[place] = lines[place].replace(base, Path(base).name)
        text = "".join(lines)
    yield file, text
