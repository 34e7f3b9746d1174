"""From a file with the key ``tune`` to the tasks that it asks for."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hgorun.config.kinds import refuse_file_of_another_command
from hgorun.config.nearest import no_file
from hgorun.config.reading import mapping, read_source
from hgorun.config.tuning import Tune, TuneFile
from hgorun.config.validation import validate
from hgorun.ensemble.members.refused import refuse
from hgorun.errors import ConfigError, HgorunError
from hgorun.plants.names import states_of
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.study.loading import load
from hgorun.tuning.task import Task, tasks

_APART = 100  # times as much, and so much less than what a file has: a first range of an example
_GAINS = 2  # in an example


@dataclass(frozen=True, eq=False)
class Asked:
    """What a file asks for.

    Attributes
    ----------
    name : str
        Files are called by it.
    text : str
        The file as it was written.
    config : Path
        The configuration whose gains are sought.
    run : str or None
        Which run of it.
    tasks : list of Task
    """

    name: str
    text: str
    config: Path
    run: str | None
    tasks: list[Task]


def load_tuning(path: Path, overrides: Sequence[str] = (), *, seed: int | None = None, run: str | None = None) -> Asked:
    """Read and check a configuration with the key ``tune``, or a file with ``base`` and ``tune``.

    Raises
    ------
    ConfigError
        For anything wrong in them: file, line, key, what was found and what would be right.
    """
    for assignment in overrides:
        if not is_of_tune(assignment):
            raise ConfigError(
                f"--set {assignment}: only keys of tune can be changed here; the tuned file would lack other changes"
            )
    text, source = read_source(path, overrides)
    refuse_file_of_another_command(source.data, path, "tune")
    data = mapping(source, "base and tune")
    if "tune" not in data:
        example = f"tune: {{gains: {{{gains_of(data)}}}, {_goal(data)}}}"
        message = f"the key tune is missing: it says which gains to tune, and for which goal; such as {example}"
        raise ConfigError(message, file=str(path))
    config = path
    if "base" in data:
        blocks = validate(TuneFile, data, source, ())
        config, run = path.parent / blocks.base, run or blocks.run
        if not os.path.isfile(config):
            file, line = source.where(("base",))
            raise ConfigError(f"{config}: {no_file(config)}", file=file, line=line, key="base")
    experiment = load(config, run=run)
    block = validate(Tune, data["tune"], source, ("tune",))
    with source.located():
        asked = Asked(path.stem, text, config, run, tasks(experiment, block))
    for task in asked.tasks:
        refuse(task.base, _ends(task))
    return asked


def is_of_tune(assignment: str) -> bool:
    """Whether an assignment of ``--set`` says how to tune, and nothing of what is tuned."""
    return assignment.startswith(("tune.", "tune="))


def gains_of(data: Mapping[str, Any]) -> str:
    """An example of gains that observers have: theta, but where Q or q is given in its place these."""
    observers = data.get("observers")
    blocks = {k: v for k, v in observers.items() if isinstance(v, dict)} if isinstance(observers, dict) else {}
    filters = [label for label, block in blocks.items() if {"Q", "q"} & block.keys()]
    others = [label for label in blocks if label not in filters]
    if not filters or others:
        return f"observers.{others[0] if filters else '*'}.theta: {{log: [0.5, 20]}}"
    path = f"observers.{filters[0]}"
    block = blocks[filters[0]]
    noise = block.get("Q", block.get("q"))
    entries = {f"Q.{state}": value for state, value in noise.items()} if isinstance(noise, dict) else {"q": noise}
    given = {key: value for key, value in entries.items() if isinstance(value, int | float)}
    numbers = {key: value for key, value in given.items() if value > 0}
    ranges = [f"{path}.{key}: {{log: [{value / _APART:g}, {value * _APART:g}]}}" for key, value in numbers.items()]
    return ", ".join(ranges[:_GAINS]) or f"{path}.Q.0.0: {{log: [1e-6, 1]}}"


def _goal(data: Mapping[str, Any]) -> str:
    """An example, with names of the file as far as they can be read."""
    if "data" in data:
        return f"minimise: 'holdout_rmse(*, {_first_output(data['data'])})'"
    plant = data.get("plant")
    states = states_of(plant) if isinstance(plant, dict) else []
    return f"minimise: 'rmse(*, {states[0] if states else 'STATE'})'"


def _first_output(data: object) -> str:
    """A name for an example: of what is recorded, where that can be read."""
    outputs = data.get("outputs") if isinstance(data, dict) else None
    names = [str(name) for name in outputs] if isinstance(outputs, dict) else []
    return next((name for name in names if name.isidentifier()), "y")


def _ends(task: Task) -> Iterator[Experiment]:
    """With all gains at the lower ends of their ranges, and at the upper ones, as far as that is admitted."""
    for end in (0, 1):
        with suppress(HgorunError):
            yield task.base.varied({gain.path: gain.range.ends[end] for gain in task.gains})
