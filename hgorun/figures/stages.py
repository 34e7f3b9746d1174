"""What the panels of a figure show: whose estimates and truths, over which time, under which title."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.study import Panel
from hgorun.errors import ConfigError, printable
from hgorun.figures.actors import Actor, cast, cast_ensembles
from hgorun.figures.followed import MembersData
from hgorun.figures.looks import Look
from hgorun.figures.panels import window_words
from hgorun.figures.scaling import ScalingData
from hgorun.figures.style import LARGEST_NUMBER
from hgorun.result.records.data import ResultData
from hgorun.result.run_names import run_names


@dataclass(frozen=True)
class Stage:
    """A panel of a figure's block with what it shows."""

    panel: Panel
    actors: Sequence[Actor]
    results: Mapping[str, ResultData]
    ensemble: ScalingData | MembersData | None

    @property
    def span(self) -> tuple[float, float] | None:
        """The time shown."""
        if self.panel.window is not None or isinstance(self.ensemble, ScalingData):
            return self.panel.window
        if self.ensemble is not None:
            return self.ensemble.span
        return span_of(list(self.results.values()))


def several_of(results: ResultData | Sequence[ResultData]) -> list[ResultData]:
    several = [results] if isinstance(results, ResultData) else list(results)
    if not several:
        raise ValueError("a figure needs at least one result")
    for result in several:
        _require_drawable(result)
    return several


def _require_drawable(result: ResultData) -> None:
    """Axes can be divided up to some size of numbers only; of an estimate that is lost only the rest is drawn."""
    shown = {"time": result.time, "the truth": result.x, "the outputs": result.y}
    shown |= {f"the estimate of {label}": o.xhat for label, o in result.observers.items() if not o.lost}
    for what, values in shown.items():
        if not np.all(np.abs(values) <= LARGEST_NUMBER):
            raise ConfigError(
                f"{printable(result.name)}: {what} cannot be drawn: numbers beyond {LARGEST_NUMBER:g}, or none"
            )


def runs_of(results: ResultData | Sequence[ResultData]) -> dict[str, ResultData]:
    several = several_of(results)
    return dict(zip(run_names(several), several, strict=True))


def stages_of(
    panels: Sequence[Panel], runs: Mapping[str, ResultData], ensembles: Mapping[int, ScalingData | MembersData]
) -> list[Stage]:
    everybody = cast(list(runs.values()))
    theirs = cast_ensembles(ensembles, len(everybody))
    stages = []
    for i, panel in enumerate(panels):
        if i in ensembles:
            stages.append(Stage(panel, [a for a in theirs[i] if a.among(panel.observers)], {}, ensembles[i]))
            continue
        if panel.scaling is not None:
            raise ValueError(f"panel {i} shows scaling, but no data were given for it")
        own = {run: r for run, r in runs.items() if panel.run in (None, run)}
        actors = [a for a in everybody if panel.output is None and a.run in own and a.among(panel.observers)]
        if panel.observers and actors:  # the truth of those picked, or everybody's
            own = {run: r for run, r in own.items() if any(a.run == run for a in actors)}
        stages.append(Stage(panel, actors, own, None))
    return stages


def titles_of(stages: Sequence[Stage], look: Mapping[int, Look]) -> list[str | None]:
    differ = len({tuple(a.order for a in stage.actors) for stage in stages if stage.actors}) > 1
    titles: list[str | None] = []
    said = False
    for stage in stages:
        title = stage.panel.title
        if title is None and differ and len(stage.actors) == 1:
            title = look[stage.actors[0].order].text
        if title is None and stage.panel.magnitude is not None and stage.ensemble is None and not said:
            title, said = window_words("error", list(stage.results.values())), True
        titles.append(title)
    return titles


def span_of(results: Sequence[ResultData]) -> tuple[float, float] | None:
    ends = [(float(r.time[0]), float(r.time[-1])) for r in results if r.time.size]
    return (min(a for a, _ in ends), max(b for _, b in ends)) if ends else None
