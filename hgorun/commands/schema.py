"""``schema``: the JSON schemas of the files that hgorun reads, for editors, and the line by which editors find them."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel

from hgorun.commands.catalogue_options import Schema
from hgorun.commands.compact_schema import compact
from hgorun.commands.described import own_doc
from hgorun.config.benchmark import BenchmarkFile
from hgorun.config.models import File
from hgorun.config.sweeps import SweepFile
from hgorun.figures.scaling import quantities
from hgorun.measurement.blocks import Measurement
from hgorun.noise.base import NOISE
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.plants.inline import InlinePlant

DIALECT = "https://json-schema.org/draft/2020-12/schema"
SCHEMA_FILE = "hgorun.schema.json"  # beside configurations
_MODELINE = re.compile(r"\A# yaml-language-server: \$schema=.*\n")


def schema(options: Schema) -> int:
    """Print a schema, with the keys of every plant, observer and kind of noise."""
    made = sweep_schema() if options.sweep else benchmark_schema() if options.benchmark else build_schema()
    print(json.dumps(made, indent=2))
    return 0


def schema_text(schema: dict[str, Any]) -> str:
    """A schema as a file, with one line for each definition, so that versions can be compared."""
    definitions = sorted(schema["$defs"].items())
    lines = (f"{json.dumps(name)}: {json.dumps(value, sort_keys=True)}" for name, value in definitions)
    rest = json.dumps({key: value for key, value in schema.items() if key != "$defs"}, indent=1, sort_keys=True)
    return f'{rest.removesuffix("}").rstrip()},\n "$defs": {{\n' + ",\n".join(lines) + "\n}}\n"


def with_schema(text: str, address: str) -> str:
    """The text of a YAML file whose first line, a comment, names the schema for editors.

    Parameters
    ----------
    text : str
        A file's text, with or without such a line.
    address : str
        Of the schema: a path as seen from the file's folder, or a URL.
    """
    return f"# yaml-language-server: $schema={address}\n{_MODELINE.sub('', text)}"


def sweep_schema() -> dict[str, Any]:
    """The schema of sweep files, whose base may be a whole configuration."""
    top, base = SweepFile.model_json_schema(), full_schema()
    definitions = top.pop("$defs", {}) | base.pop("$defs")
    base.pop("$schema")
    description = top["properties"]["base"]["description"]
    whole = {"$ref": "#/$defs/Configuration"}
    top["properties"]["base"] = {"anyOf": [{"type": "string"}, whole], "description": description}
    return compact({"$schema": DIALECT, **top, "$defs": definitions | {"Configuration": base}})


def benchmark_schema() -> dict[str, Any]:
    """The schema of benchmark files, whose contestants are observers."""
    top, observers = BenchmarkFile.model_json_schema(), full_schema()
    block = top["$defs"]["Contestant"]["properties"]["block"]
    blocks = observers["properties"]["observers"]["additionalProperties"]
    top["$defs"]["Contestant"]["properties"]["block"] = {"description": block["description"], **blocks}
    return compact({"$schema": DIALECT, **top, "$defs": _used(top["$defs"], observers["$defs"] | top["$defs"])})


def _used(wanted: dict[str, Any], every: dict[str, Any]) -> dict[str, Any]:
    """Definitions with all that they refer to, directly or not."""
    found: dict[str, Any] = {}
    todo = list(wanted)
    while todo:
        name = todo.pop()
        if name not in found:
            found[name] = every[name]
            todo += re.findall(r'"#/\$defs/([^"]+)"', json.dumps(every[name]))
    return found


def build_schema() -> dict[str, Any]:
    """The schema of configurations, in as few words as possible."""
    top = full_schema()
    definitions = top["$defs"]
    for block in (top, *(definitions[name] for name in _outside_lists(top, definitions))):
        block["properties"] = {key: _or_null(key, one) for key, one in block.get("properties", {}).items()}
    return compact(top)


def full_schema() -> dict[str, Any]:
    """The schema of configurations, every block written out in full."""
    top = File.model_json_schema()
    definitions = top.setdefault("$defs", {})

    def add(model: type[BaseModel], name: str, constant: str | None = None, *, whole: bool = False) -> dict[str, str]:
        own = model.model_json_schema(ref_template="#/$defs/{model}")
        definitions.update(own.pop("$defs", {}))
        if not whole:
            own.pop("required", None)
        if constant is not None:
            own["properties"]["type"] = {"const": constant}
            own["description"] = _in_a_line(model, constant)
        definitions[name] = own
        return {"$ref": f"#/$defs/{name}"}

    plants = [add(cls, f"plant-{name}", name) for name, cls in PLANTS.all().items()]
    observers = [add(cls, f"observer-{name}", name) for name, cls in OBSERVERS.all().items()]
    inline = add(InlinePlant, "plant-inline", "inline")
    top["properties"]["plant"] = {
        "description": top["properties"]["plant"]["description"],
        "anyOf": [*plants, inline],
    }
    of_inline = definitions["plant-inline"]["properties"]
    named = of_inline["output"]
    unnamed = [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]
    of_inline["output"] = {"description": named.pop("description"), "anyOf": [*unnamed, named]}
    top["properties"]["observers"]["additionalProperties"] = {"anyOf": observers}
    top["properties"]["measurement"] = add(Measurement, "Measurement")
    definitions["Scaling"]["properties"]["of"]["examples"] = list(quantities())
    definitions["Noise"] = {"anyOf": [add(cls, f"noise-{name}", name, whole=True) for name, cls in NOISE.all().items()]}
    for incomplete in (top, *(definitions[name] for name in _outside_lists(top, definitions))):
        incomplete.pop("required", None)
    return {"$schema": DIALECT, **top}


def _or_null(key: str, schema: dict[str, Any]) -> dict[str, Any]:
    """A key's schema that takes null as well, which removes an inherited key; so with keys of mappings of blocks."""
    if key in ("type", "extends") or "const" in schema:
        return schema
    inside = schema.get("additionalProperties")
    if isinstance(inside, dict):
        schema = {**schema, "additionalProperties": _or_null("", inside)}
    described: dict[str, Any] = {
        name: schema[name] for name in ("description", "default", "examples") if name in schema
    }
    rest = {name: value for name, value in schema.items() if name not in described}
    alternatives = rest["anyOf"] if list(rest) == ["anyOf"] else [rest]
    if {"type": "null"} in alternatives:
        return schema
    return {**described, "anyOf": [*alternatives, {"type": "null"}]}


def _in_a_line(model: type[BaseModel], name: str) -> str:
    """What an editor shows of a plant or an observer: the rest of its page is long."""
    first = own_doc(model).split("\n\n")[0].replace("\n", " ")
    return f"{first} More: hgorun show {name}" if first else f"See hgorun show {name}"


def _outside_lists(top: dict[str, Any], definitions: dict[str, Any]) -> set[str]:
    """Definitions of blocks that a file may write in part, since it extends another one, or another one extends it.

    Items of lists are replaced as a whole, and so are complete.
    """
    found: set[str] = set()
    todo: list[Any] = [top["properties"]]
    while todo:
        match todo.pop():
            case {"$ref": str(reference)} if (name := reference.removeprefix("#/$defs/")) not in found:
                found.add(name)
                todo.append(definitions[name])
            case dict(part):
                todo += [value for key, value in part.items() if key not in ("items", "prefixItems", "$defs")]
            case list(parts):
                todo += parts
    return found
