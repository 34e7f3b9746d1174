"""The ensemble of a study's run: its seeds, and what it varies, as axes; carried out where its files are kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

from hgorun.config.sweeps import SweepBlocks
from hgorun.ensemble.executors import threads
from hgorun.ensemble.folder.store import Changed, Store
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.refused import refuse_base
from hgorun.ensemble.sweep import Count, Place, carry_out, finished
from hgorun.files import remove_file
from hgorun.process import processors
from hgorun.study.study import Run
from hgorun.study.varied_paths import refuse_paths

Followed = Literal["all", "some", "none"]

_FEW = 60  # members of what is varied, whose trajectories are kept
_DRAWN = 200  # members that a figure shows at most
_NUMBERS = 4e7  # of their trajectories, likewise


def ensemble_of(run: Run, quantities: Sequence[str] = (), *, followed: Followed | None = None) -> Ensemble:
    """The ensemble that a run with ``seeds`` or ``vary`` is.

    Values come one after the other, each with all seeds. Where one path is set, members are a product of axes; where
    several are, each path has the values of all members.

    Parameters
    ----------
    quantities : sequence of str
        What is measured besides all metrics.
    followed : {"all", "some", "none"}, optional
        Whose trajectories are kept: some are as many as a figure shows. By default all of what is varied, if
        members are few.

    Raises
    ------
    ConfigError
        When a member cannot be made, or paths of ``vary`` lead nowhere.
    """
    refuse_paths(run)
    axes = _axes(run)
    if followed is None:
        few = run.ensemble.kind == "vary" and len(run.values) <= _FEW and run.one_grid
        followed = "all" if few else "none"
    keep = {"trajectories": _some(run) if followed == "some" else followed, "quantities": list(quantities)}
    combine = "zip" if len(axes.keys() - {"seed"}) > 1 else "product"
    blocks = SweepBlocks.model_validate({"axes": axes, "combine": combine, "keep": keep})
    return Ensemble(name=run.name, base=run.base, blocks=blocks, text=run.text)


def _some(run: Run) -> str | dict[str, int]:
    """Members whose trajectories a figure can show: all, or some at regular places."""
    base, size = run.base, run.shape[0] * run.shape[1]
    points = base.grid[0].size // base.grid[1] + 1
    each = points * len(base.plant.model.states) * (len(base.observers) + 1)
    most = int(min(_DRAWN, max(_NUMBERS // each, 1)))
    return "all" if size <= most else {"every": -(-size // most)}


def _axes(run: Run) -> dict[str, Any]:
    seeds = {"seed": {"count": len(run.seeds)}} if run.ensemble.seeds is not None else {}
    if run.ensemble.vary is None:
        return seeds
    members = [run.changes(value) for value in run.values]
    columns = {path: [changes[path] for changes in members] for path in members[0]}
    if len(columns) == 1 or not seeds:
        return columns | seeds
    each = {path: [value for value in column for _ in run.seeds] for path, column in columns.items()}
    return each | {"seed": [seed for _ in members for seed in run.seeds]}


def carried_out(
    ensemble: Ensemble, place: Place, told: Callable[[Count], None] = lambda _: None, *, workers: int | None = None
) -> None:
    """Carry out what is missing of a run's ensemble, and collect its file.

    Members of another configuration are replaced.

    Parameters
    ----------
    workers : int, optional
        Threads; by default one a processor.

    Raises
    ------
    HgorunError
        When the base is refused, or files cannot be written.
    """
    refuse_base(ensemble)
    try:
        store = Store.opened(place.folder, ensemble)
    except Changed:
        remove_file(place.file)
        store = Store.opened(place.folder, ensemble, fresh=True)

    def carry() -> None:
        carry_out(store, threads(workers or processors()), told=told)

    carry()
    finished(store, place.file, carry)
