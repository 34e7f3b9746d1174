"""What has been made of a study already, and whether it still stands.

Beside the runs of a study lies ``state.json`` with a key for each run, figure and claim: the hash of all that
the result depends on, the package's own source included. What has its key is not made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from hgorun.files import write_text
from hgorun.study.quantities import Quantity
from hgorun.study.split import OF_THE_FILE
from hgorun.study.study import Run, Study
from hgorun.version import __version__

_NOT_OF_A_RUN = {*OF_THE_FILE, "extends", "reference"}


@cache
def package_digest() -> str:
    """Hash of the version and of the package's source: a checkout whose code has changed draws anew."""
    digest = hashlib.sha256(__version__.encode())
    folder = Path(__file__).parents[1]
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _key(*parts: Any) -> str:
    return hashlib.sha256(json.dumps([package_digest(), *parts], default=str).encode()).hexdigest()


def run_key(run: Run) -> str:
    """Of a run: its configuration, and what makes an ensemble of it."""
    data = {key: part for key, part in run.source.data.items() if key not in _NOT_OF_A_RUN}
    return _key(run.name, data, run.ensemble.model_dump(mode="json"))


def figure_key(study: Study, name: str) -> str:
    """Of a figure: its block and its runs."""
    block = study.figures[name].model_dump(mode="json")
    return _key(name, block, [run_key(study.runs[run]) for run in study.runs_of(name)])


def claim_key(study: Study, i: int) -> str:
    """Of a claim's number: its expression and its runs. The threshold is compared anew each time."""
    runs = dict.fromkeys(run for quantity in study.sentences[i].quantities for run, _ in quantity.of)
    return _key(study.claims[i].value, [run_key(study.runs[run]) for run in runs])


class State:
    """The record of a study, kept in a folder.

    Attributes
    ----------
    folder : Path
        Holds ``state.json``, a result file a run, and a file of numbers an ensemble.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.data: dict[str, dict[str, Any]] = {"runs": {}, "figures": {}, "claims": {}}
        found = _read_json(folder / "state.json")
        for kind in self.data:
            part = found.get(kind) if isinstance(found, dict) else None
            if isinstance(part, dict):
                self.data[kind] = {name: entry for name, entry in part.items() if isinstance(entry, dict)}

    def holds(self, kind: str, name: str, key: str) -> bool:
        """Whether an entry was made from just this, and its files are there."""
        entry = self.data[kind].get(name, {})
        return entry.get("key") == key and all((self.folder / file).is_file() for file in entry.get("files", ()))

    def note(self, kind: str, name: str, key: str, **entry: Any) -> None:
        """Record what was made, whole or not at all."""
        self.data[kind][name] = {"key": key, **entry}
        write_text(self.folder / "state.json", json.dumps(self.data, indent=1))

    def members(self, run: Run, quantities: Sequence[Quantity]) -> list[dict[str, float]]:
        """What is known of the members of an ensemble: those of which all quantities were measured."""
        found = _read_json(self.folder / f"{run.name}.json")
        if not isinstance(found, dict) or found.get("key") != run_key(run):
            return []
        complete = []
        for member in found.get("members", []):
            try:
                complete.append({str(q): float(member[str(q)]) for q in quantities})
            except (KeyError, TypeError, ValueError):
                break
        return complete

    def keep_members(self, run: Run, members: list[dict[str, float]]) -> None:
        """Record the members of an ensemble carried out so far."""
        entry = {"key": run_key(run), "varied": list(run.varied), "members": members}
        write_text(self.folder / f"{run.name}.json", json.dumps(entry, indent=1))


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None  # missing, or not ours: made anew
