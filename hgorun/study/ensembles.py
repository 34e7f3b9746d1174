"""The ensemble of a study's run: its seeds, or what it varies, as axes."""

from __future__ import annotations

from typing import Any

from hgorun.config.sweeps import SweepBlocks
from hgorun.ensemble.ensemble import Ensemble
from hgorun.study.study import Run

_FEW = 60  # members of what is varied, whose trajectories are kept


def ensemble_of(run: Run) -> Ensemble:
    """The ensemble that a run with ``seeds`` or ``vary`` is.

    What is varied has an axis for every path that is set, with the values of all members one after the other. The
    trajectories of few members are kept, so that they can be drawn.

    Raises
    ------
    ConfigError
        When a member cannot be made.
    """
    axes: dict[str, Any]
    if run.ensemble.seeds is not None:
        axes = {"seed": {"count": run.ensemble.seeds}}
    else:
        members = [run.changes(value) for value in run.varied]
        axes = {path: [changes[path] for changes in members] for path in members[0]}
    one_grid = not any(path.partition(".")[0] == "time" for path in axes)
    followed = "all" if run.ensemble.seeds is None and len(run.varied) <= _FEW and one_grid else "none"
    blocks = SweepBlocks.model_validate(
        {"axes": axes, "combine": "zip" if len(axes) > 1 else "product", "keep": {"trajectories": followed}}
    )
    return Ensemble(name=run.name, base=run.base, blocks=blocks, text=run.text)
