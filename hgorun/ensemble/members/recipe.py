"""An ensemble as text, which any process turns into the same members.

Where the lines of the configuration stood is not part of it: what is recorded of a member that fails must not depend
on who has carried it out.
"""

from __future__ import annotations

import json
from typing import Any

from hgorun.config.sweeps import SweepBlocks
from hgorun.config.yaml_source import Source
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.memo import Memo
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.experiment.resolved import plain

_NOT_OF_A_MEMBER = ("figures", "claims", "tune", "runs")
_ENSEMBLES: Memo[Ensemble] = Memo(4)


def recipe_of(ensemble: Ensemble) -> str:
    """The text, JSON in one line."""
    data = {key: part for key, part in ensemble.base.source.data.items() if key not in _NOT_OF_A_MEMBER}
    found = {
        "name": ensemble.name,
        "title": ensemble.title,
        "text": ensemble.text,
        "base": plain(data),
        "sweep": written(ensemble.blocks),
    }
    return json.dumps(found, sort_keys=False)


def ensemble_of(recipe: str) -> Ensemble:
    """The ensemble that a text says; the same object for the same text, so that nothing is compiled twice.

    Raises
    ------
    ConfigError
        Where its configuration cannot be used here, for instance for want of a plug-in.
    """
    return _ENSEMBLES.get(recipe, lambda: _made(recipe))


def _made(recipe: str) -> Ensemble:
    said: dict[str, Any] = json.loads(recipe)
    base = Experiment(Source(said["base"], {}), name=said["name"])
    blocks = SweepBlocks.model_validate(said["sweep"])
    return Ensemble(name=said["name"], base=base, blocks=blocks, title=said["title"], text=said["text"])


def written(blocks: SweepBlocks) -> dict[str, Any]:
    """Axes, combination and what is kept as a sweep file says them, with nothing omitted."""
    said = blocks.model_dump(mode="json", include=set(SweepBlocks.model_fields), exclude_none=True)
    said["axes"] = {path: axis.get("values", axis) for path, axis in said["axes"].items()}
    return said
