"""``list``, ``show``: what there is."""

from __future__ import annotations

import json as json_text
import os
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from hgorun.commands import described, publications
from hgorun.commands.catalogue_options import List, Show
from hgorun.commands.given import refuse_what_is_no_configuration
from hgorun.config import yaml_source
from hgorun.config.expressions import nearest
from hgorun.config.reading import read_source
from hgorun.errors import ConfigError
from hgorun.noise.base import NOISE, Noise
from hgorun.observers.base import OBSERVERS, AnyObserver
from hgorun.plants.base import PLANTS, Plant
from hgorun.registry import Registry
from hgorun.reproduce.shipped import experiments
from hgorun.result.metrics.base import all_metrics
from hgorun.tables.layout import entry, wrapped

if TYPE_CHECKING:
    from hgorun.analysis.finding import Finding

_REGISTRIES: Mapping[str, Registry[type[Plant]] | Registry[type[AnyObserver]] | Registry[type[Noise]]] = {
    "plants": PLANTS,
    "observers": OBSERVERS,
    "noise": NOISE,
}
_KINDS = (*_REGISTRIES, "metrics", "findings", "experiments")


def _first_line(cls: type) -> str:
    return described.own_doc(cls).split("\n\n")[0].replace("\n", " ")


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
        return {name: finding.meaning.replace(r"\|", "|") for name, finding in _findings().items()}
    if kind == "metrics":
        return {name: metric.meaning for name, metric in all_metrics(closed=True).items()}
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
    for k, entries in found.items():
        print(f"{k}:")
        beside = max(map(len, entries))
        for name, line in entries.items():
            print("\n".join(entry(name, line, beside)))
    return 0


def show(options: Show) -> int:
    """Everything about one entry."""
    name, json = options.name, options.json
    for registry in _REGISTRIES.values():
        classes = registry.all()
        if name in classes:
            found = described.of_class(name, registry.kind, classes[name])
            print(json_text.dumps(found, indent=2) if json else described.as_text(found))
            return 0
    metrics = all_metrics(closed=True)
    if name in metrics:
        return _told(described.of_metric(metrics[name]), json=json)
    findings = _findings()
    if name in findings:
        return _told(described.of_finding(findings[name]), json=json)
    shipped = experiments()
    for path, file in shipped.items():
        if name in (path, Path(path).name):
            text = file.read_text(encoding="utf-8")
            print(json_text.dumps({"name": path, "kind": "experiment", "text": text}) if json else text)
            return 0
    if of_publications := publications.of_name(name):
        texts = ("\n".join(chain(*map(wrapped, publications.as_lines(one)))) for one in of_publications)
        print(json_text.dumps(of_publications, indent=2) if json else "\n\n".join(texts))
        return 0
    known = [*(name for registry in _REGISTRIES.values() for name in registry.names()), *metrics, *findings, *shipped]
    if os.path.isfile(name):  # of names, also of such that no file can have
        refuse_what_is_no_configuration(Path(name), "show")
        read_source(name)  # which refuses most of what is no YAML
        with_words = f"hgorun cite {name} says what it uses, hgorun analyze {name} what theory says of it"
        raise ConfigError(f"show is for names, see hgorun list; this is a file: {with_words}", file=name)
    if name in _KINDS or f"{name}s" in _KINDS:
        raise ConfigError(f"{name!r} is a list: see hgorun list {name if name in _KINDS else f'{name}s'}")
    hint = nearest(name, [*known, *publications.names()])
    raise ConfigError(f"nothing is called {name!r}.{hint} See hgorun list; figures and folders are shown, too")


def _told(record: described.Record, *, json: bool) -> int:
    lines = [line for k, v in record.items() for line in wrapped(f"{k}: {v}")]
    print(json_text.dumps(record, indent=2) if json else "\n".join(lines))
    return 0


def _findings() -> dict[str, Finding]:
    from hgorun.analysis.finding import all_findings  # with all of the analysis, which nothing else here needs

    return {finding.name: finding for finding in all_findings()}
