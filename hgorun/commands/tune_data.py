"""``tune`` of a configuration with ``data``: gains that a recording speaks for."""

from __future__ import annotations

import json as json_text
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hgorun.commands.estimate import log_of
from hgorun.commands.options import Tune as Options
from hgorun.commands.outputs import RESULTS
from hgorun.config.tuning import Range, Tune
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.data.recording import Recording
from hgorun.ensemble.members import written_out
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.completed import completed
from hgorun.estimate.tuning import Goal, Trials, read_goal, score, search, split
from hgorun.files import json_value, write_text
from hgorun.process import say
from hgorun.simulation.experiment import Experiment
from hgorun.tables.layout import number, packed
from hgorun.tuning.written import with_numbers

_END = 1e-3  # of a range: what is nearer to an end of it is at the end


@dataclass(frozen=True, eq=False, repr=False)
class _Tuned:
    """The best gains of an observer, and the score with them."""

    goal: Goal
    gains: dict[str, float]
    tuned: float
    held_out: float
    runs: int


def tune_data(options: Options, text: str, source: Source) -> int:
    """Seek the gains, write the tuned configuration and print what was found."""
    if isinstance(source.data, dict) and "runs" in source.data:
        raise ConfigError("of recorded data a configuration without runs is tuned", file=str(options.config))
    block = validate(Tune, source.data["tune"], source, ("tune",))
    with source.located():
        if len(block.minimise) > 1 or block.subject:
            raise Problem(("tune", "minimise"), "of recorded data one score is minimised, and nothing is bounded")
        log = log_of(source, options.config)
        recording = log.read()
        experiment = completed(source, recording, options.config.stem, text)
        found = [_tuned(experiment, recording, goal, gains, block.runs) for goal, gains in _tasks(experiment, block)]
    folder = options.output or RESULTS
    target = folder / f"{options.config.stem}.tuned.yaml"
    for one in found:
        _warn(one, options.config.stem, block)
    numbers = {path: value for one in found for path, value in one.gains.items()}
    write_text(target, with_numbers(options.config, numbers, target))
    if options.json:
        print(json_text.dumps(json_value(_as_json(found, options.config.stem, target)), indent=2, allow_nan=False))
    elif options.text:
        print("\n".join(_table(found)))
        print(f"written: {target}")
    return 0


def _tasks(experiment: Experiment, block: Tune) -> list[tuple[Goal, dict[str, Range]]]:
    """What is minimised, and with which gains: of every observer that has them, where the goal is of ``*``."""
    goal = read_goal(block.minimise[0], ("tune", "minimise", 0))
    found: dict[str, dict[str, Range]] = {}
    for key, given in block.gains.items():
        try:
            paths = written_out(experiment, key)
        except ConfigError as error:
            raise Problem(("tune", "gains", key), error.message) from None
        for path in paths:
            label = next((one for one in experiment.observers if path.startswith(f"observers.{one}.")), None)
            if label is None:
                raise Problem(("tune", "gains", key), "of recorded data the gains of observers are sought")
            found.setdefault(label, {})[path] = given
    wanted = list(found) if goal.label == "*" else [goal.label]
    missing = [label for label in wanted if label not in found]
    if missing:
        raise Problem(("tune", "minimise", 0), f"no gains of an observer {missing[0]!r} are sought")
    return [(Goal(goal.score, label, goal.name), found[label]) for label in wanted]


def _tuned(experiment: Experiment, recording: Recording, goal: Goal, gains: dict[str, Range], budget: int) -> _Tuned:
    others = {f"observers.{label}": None for label in experiment.observers if label != goal.label}
    alone = experiment.varied(others) if others else experiment
    samples = split(recording, goal)
    trials = Trials(alone, goal, gains, samples, budget)
    best = search(trials)
    least = min(value for _, value in trials.tried)
    held_out = score(alone.varied(best), goal, samples.given, samples.report)
    return _Tuned(goal, best, least, held_out, len(trials.tried))


def _warn(one: _Tuned, name: str, block: Tune) -> None:
    """Gains at an end of their range are reported on stderr."""
    for key, given in block.gains.items():
        low, high = given.ends
        for path, value in one.gains.items():
            matches = path == key or ("*" in key and path.rpartition(".")[2] == key.rpartition(".")[2])
            if matches and not low + _END * (high - low) < value < high - _END * (high - low):
                say(f"hgorun: {name}: {path} = {value:g} is at an end of its range: better values may lie beyond it")


def _table(found: Sequence[_Tuned]) -> list[str]:
    goal = found[0].goal
    columns = [
        [f"{goal.score} {goal.name}: search", *(number(one.tuned) for one in found)],
        ["held out", *(number(one.held_out) for one in found)],
        ["runs", *(str(one.runs) for one in found)],
    ]
    names = dict.fromkeys(path.split(".", 2)[2] for one in found for path in one.gains)
    for name in names:
        values = [{path.split(".", 2)[2]: v for path, v in one.gains.items()}.get(name) for one in found]
        columns.insert(0, [name, *map(number, values)])
    blocks = packed([one.goal.label for one in found], [[column] for column in columns])
    return [line for block in blocks for line in block]


def _as_json(found: Sequence[_Tuned], name: str, target: Path) -> dict[str, object]:
    observers = {
        one.goal.label: {
            "runs": one.runs,
            "gains": one.gains,
            "tuned": {str(one.goal): one.tuned},
            "held_out": {str(one.goal): one.held_out},
        }
        for one in found
    }
    return {"name": name, "files": [str(target)], "observers": observers}
