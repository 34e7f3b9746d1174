"""What has been made of a study already, and whether it still stands.

Beside the runs of a study lies ``state.json`` with the ingredients of each run, figure and claim: {what it is called in
a message: its hash}, for everything that the result follows from, the package's own code included. What has the same
ingredients is not made again; the first one that differs is the reason why something is.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TypeAlias

from hgorun.analysis.finding import all_findings
from hgorun.code import FIGURE, QUANTITY, RUN, SCALING, THEORY, code, code_of
from hgorun.files import write_text
from hgorun.measurement.blocks import noise_blocks
from hgorun.result.metrics.base import all_metrics
from hgorun.study.study import Run, Study
from hgorun.version import __version__

Ingredients: TypeAlias = Mapping[str, str]
Json: TypeAlias = "dict[str, Json] | list[Json] | str | float | bool | None"

_KINDS = ("runs", "figures", "claims")
_VERSION = "hgorun"


def _hash(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


@cache
def _code(*groups: Sequence[str]) -> dict[str, str]:
    return {
        _VERSION: __version__,
        **{room: digest[:16] for room, digest in code([part for g in groups for part in g]).items()},
    }


def _runs(runs: Sequence[Run]) -> dict[str, str]:
    """Their resolved configurations, what makes ensembles of them, and the code that other packages bring."""
    found = code_of(metric.measure for metric in all_metrics(closed=True).values())
    for run in runs:
        experiment = run.experiment
        noise = chain.from_iterable(items for _, items in noise_blocks(experiment.measurement))
        found |= code_of(map(type, (experiment.plant_block, *experiment.observers.values(), *noise)))
        ensemble = run.ensemble.model_dump(mode="json", exclude_none=True)
        found[f"configuration of run {run.name}"] = _hash(experiment.resolved_text, ensemble)
    return found


def of_run(run: Run) -> Ingredients:
    """Of a run: its resolved configuration, what makes an ensemble of it, and the code that carries it out."""
    return _code(RUN) | _runs([run])


def of_figure(study: Study, name: str) -> Ingredients:
    """Of a figure: its block, its runs, and the code that draws it."""
    figure = study.figures[name]
    runs = [study.runs[run] for run in study.runs_of(name)]
    groups = [RUN, FIGURE]
    scalings = [panel.scaling for panel in figure.panels if panel.scaling is not None]
    if study.followed(name):
        groups.append(QUANTITY)
    if scalings:
        groups += [QUANTITY, SCALING]
    if any(scaling.theory for scaling in scalings):
        groups.append(THEORY)
    block = {"the figure's block": _hash(figure.model_dump(mode="json", exclude_none=True))}
    return _code(*groups) | _runs(runs) | block


def of_claim(study: Study, number: int) -> Ingredients:
    """Of a claim's numbers: its expressions, its runs, and the code that measures them.

    The thresholds are compared anew each time; what an observer that diverged counts as depends on their direction.
    """
    quantities = study.quantities(number)
    runs = [study.runs[name] for name in dict.fromkeys(run for q in quantities for run, _ in q.of)]
    groups, theirs = [RUN, QUANTITY], dict[str, str]()
    if any(quantity.function == "analysis" for quantity in quantities):
        groups.append(THEORY)
        theirs = code_of(finding.of for finding in all_findings())
    claim = study.claims[number]
    asked = [(one.value, one.relation, claim.divergence) for one in claim.inequalities]
    value = {"the claim's value": _hash(*(part for one in asked for part in map(str, one)))}
    return _code(*groups) | theirs | _runs(runs) | value


def difference(made_of: Ingredients, now: Ingredients) -> str | None:
    """In one phrase what has changed between two lists of ingredients; None for nothing.

    The version is named before the code, and the code before the configuration: each may be why the next differs.
    """
    changed = [name for name in dict.fromkeys([*now, *made_of]) if made_of.get(name) != now.get(name)]
    if not changed:
        return None
    if _VERSION in changed:
        return f"hgorun {made_of.get(_VERSION, 'unknown')} -> {now.get(_VERSION, 'unknown')}"
    rooms = [name for name in changed if " " not in name]
    first = " and ".join(rooms) if rooms else changed[0]
    return f"{first} changed"


class State:
    """The record of a study, kept in a folder.

    Attributes
    ----------
    folder : Path
        Holds ``state.json``, a result file a run, and what sweeps have an ensemble.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        found = _read_json(folder / "state.json")
        self.data: dict[str, dict[str, dict[str, Json]]] = {
            kind: {name: entry for name, entry in _mapping(found.get(kind)).items() if isinstance(entry, dict)}
            for kind in _KINDS
        }

    def why(self, kind: str, name: str, now: Ingredients) -> str | None:
        """In one phrase why an entry has to be made anew; None where it stands."""
        if name not in self.data[kind]:
            return "for the first time in this folder"
        entry = self.data[kind][name]
        made_of = entry.get("made_of")
        if not isinstance(made_of, dict):
            return "made by another version of hgorun"
        missing = [file for file in self.files(kind, name) if not (self.folder / file).is_file()]
        if missing:
            return f"file missing: {Path(missing[0]).name}"
        return difference({key: str(value) for key, value in made_of.items()}, now)

    def holds(self, kind: str, name: str, now: Ingredients) -> bool:
        """Whether an entry was made of just these ingredients, and its files are there."""
        return self.why(kind, name, now) is None

    def files(self, kind: str, name: str) -> list[str]:
        """The files of an entry, as seen from the folder."""
        return [str(file) for file in _list(self.data[kind][name].get("files"))]

    def values(self, kind: str, name: str) -> list[list[float]]:
        """The numbers of an entry, a list for each of its parts."""
        return [[number(value) for value in _list(part)] for part in _list(self.data[kind][name].get("values"))]

    def note(self, kind: str, name: str, made_of: Ingredients, **entry: Json) -> None:
        """Record what was made, whole or not at all."""
        self.data[kind][name] = {"made_of": dict(made_of), **entry}
        write_text(self.folder / "state.json", json.dumps(self.data, indent=1))


def _read_json(path: Path) -> dict[str, Json]:
    """A file's mapping; an empty one where it is missing or not ours, and everything is made anew."""
    try:
        return _mapping(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def _mapping(value: Json) -> dict[str, Json]:
    return value if isinstance(value, dict) else {}


def _list(value: Json) -> list[Json]:
    return value if isinstance(value, list) else []


def number(value: Json) -> float:
    """A number of a record; ValueError when it is something else."""
    if not isinstance(value, (int, float)):
        raise ValueError(f"expected a number, found {value!r}")
    return float(value)
