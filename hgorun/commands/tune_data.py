"""``tune`` of a configuration with ``data``: gains that a recording speaks for."""

from __future__ import annotations

import json as json_text
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hgorun.commands.ensemble_options import Tune as Options
from hgorun.commands.outputs import RESULTS, refuse_unwritable, there, written
from hgorun.commands.remarks import of_run
from hgorun.config.nearest import among
from hgorun.config.tuning import Tune, require_few
from hgorun.config.validation import validate
from hgorun.config.written import rounded, with_values
from hgorun.config.yaml_source import Source
from hgorun.ensemble.members.members import written_out
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.completed import completed
from hgorun.estimate.gains.cases import Case
from hgorun.estimate.gains.determined import standard_errors
from hgorun.estimate.gains.goal import ALL, Goal, Split, read_goal, split
from hgorun.estimate.gains.tuning import Trials, reported, search
from hgorun.estimate.holdout import of_one_time, thinned
from hgorun.estimate.log import Log, log_of
from hgorun.estimate.samples import stated
from hgorun.estimate.twins import of_references
from hgorun.files import json_value, write_text
from hgorun.process import say
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.tables.layout import number, packed, wrapped
from hgorun.tuning.gain import Gain, at_an_end, refuse_ends, refuse_unasked
from hgorun.tuning.loading import is_of_tune

_OF_PLANT = "plant.parameters."


@dataclass(frozen=True, eq=False, repr=False)
class _Tuned:
    """The best gains of an observer, the score with them, and what is told of it.

    ``kept``: they are those of the file, since all that were tried are as good. ``spread``: standard errors of gains,
    of those that are known.
    """

    goal: Goal
    sought: list[Gain]
    gains: dict[str, float]
    tuned: float
    held_out: float
    runs: int
    budget: int
    remarks: list[str]
    kept: bool
    spread: dict[str, float]

    @property
    def no_other_than_zero(self) -> list[str]:
        """The gains that might be zero, which their ranges contain, as far as the recordings tell."""
        at_zero = (gain for gain in self.sought if gain.range.ends[0] <= 0 <= gain.range.ends[1])
        return [one.path for one in at_zero if abs(self.gains[one.path]) < 2 * self.spread.get(one.path, 0.0)]


def tune_data(options: Options, text: str, source: Source) -> int:
    """Seek the gains, write the tuned configuration and print what was found."""
    if isinstance(source.data, dict) and "runs" in source.data:
        raise ConfigError("with recorded data, a configuration without runs is tuned", file=str(options.config))
    target = (options.output or RESULTS) / f"{options.config.stem}.tuned.yaml"
    refuse_unwritable(target, kind="file")
    block = validate(Tune, source.data["tune"], source, ("tune",))
    with source.located():
        if len(block.minimise) > 1 or block.subject:
            raise Problem(("tune", "minimise"), "with recorded data, one score is minimised, and nothing is bounded")
        goal = read_goal(block.minimise[0], ("tune", "minimise", 0))
        logs = [log_of(source, options.config, (file,)) for file in options.data] or [log_of(source, options.config)]
        samples = [_samples(log, goal, options.config.stem) for log in logs]
        experiments = [completed(source, one.given, options.config.stem, text) for one in samples]
        cases = [Case(experiment, one) for experiment, one in zip(experiments, samples, strict=True)]
        _check_deviations(goal, experiments[0])
        tasks = _tasks(experiments[0], goal, block)
        found = [
            _tuned(cases, one, gains, block.runs(len(gains), recorded=True), _as_given(source, gains))
            for one, gains in tasks
        ]
    for one in (one for one in found if not one.kept):
        _warn(one, options.config.stem, experiments[0])
    _tell(found, options.config.stem)
    numbers = {path: rounded(value) for one in found if not one.kept for path, value in one.gains.items()}
    before = there([target])
    overrides = [one for one in options.overrides if not is_of_tune(one)]
    write_text(target, _with_overrides(with_values(options.config, numbers, target, overrides=overrides), overrides))
    if overrides:
        say(f"hgorun: {options.config.stem}: {target} has the values of --set, too")
    if options.json:
        print(json_text.dumps(json_value(_as_json(found, options.config.stem, target)), indent=2, allow_nan=False))
    elif options.text:
        print(_table(found))
        print(written([target], before))
    return 0


def _with_overrides(text: str, overrides: Sequence[str]) -> str:
    """The tuned configuration, and what it has from the command line."""
    said = (f"# --set {' '.join(one.split())}\n" for one in overrides)
    return "".join(line for line in said if line not in text) + text


def _samples(log: Log, goal: Goal, name: str) -> Split:
    """A recording, what the observers get of it, and what they do not get; a reference that they get is told of."""
    whole = log.read()
    recording, between = thinned(whole, log.block.period)
    if goal.score == "reference_rmse":
        for note in (*(one for one in recording.notes if one.kind == "used"), *of_references(recording)):
            if note.signal == f"reference.{goal.name}":
                say(f"hgorun: {of_run(name, str(note))}")
    found = split(recording, goal, between)
    for note in (*found.given.notes[len(whole.notes) :], *of_one_time(whole, found.given)):
        say(f"hgorun: {of_run(name, str(note))}")
    return found


def _check_deviations(goal: Goal, experiment: Experiment) -> None:
    """Errors of several outputs are added in standard deviations of their noise."""
    if goal.name == ALL:
        without = [output for output in experiment.plant.model.outputs if output not in stated(experiment)]
        if without:
            message = f"{goal}: errors of all outputs are counted in standard deviations: {without[0]} has no std"
            raise Problem(("tune", "minimise", 0), message)


def _tasks(experiment: Experiment, goal: Goal, block: Tune) -> list[tuple[Goal, list[Gain]]]:
    """What is minimised, and with which gains: of every observer that has them, where the goal is of ``*``."""
    found: dict[str, dict[str, Gain]] = {}
    of_plant: dict[str, Gain] = {}
    for key, given in block.gains.items():
        if key.startswith(_OF_PLANT):
            if (name := key.removeprefix(_OF_PLANT)) not in experiment.plant.model.parameters:
                known = among(name, experiment.plant.model.parameters)
                raise Problem(("tune", "gains", key), f"the plant has no such parameter; there are {known}")
            of_plant[key] = Gain(key, given, key)
            continue
        try:
            paths = written_out(experiment, key)
        except ConfigError as error:
            raise Problem(("tune", "gains", key), error.message) from None
        for path in paths:
            label = next((one for one in experiment.observers if path.startswith(f"observers.{one}.")), None)
            if label is None:
                message = "with recorded data, gains of observers and parameters of the plant are tuned"
                raise Problem(("tune", "gains", key), message)
            found.setdefault(label, {})[path] = Gain(path, given, key)
    if of_plant and goal.label == "*":
        raise Problem(
            ("tune", "minimise", 0), "observers share the plant: with its parameters name one observer, not *"
        )
    wanted = list(found) if goal.label == "*" else [goal.label]
    missing = [label for label in wanted if label not in found and not (of_plant and label in experiment.observers)]
    if missing:
        raise Problem(("tune", "minimise", 0), f"no gains of an observer {missing[0]!r} are sought")
    for label in (one for one in found if one not in wanted):
        refuse_unasked(next(iter(found[label].values())).key, label)
    tasks = [(Goal(goal.score, label, goal.name), [*{**of_plant, **found.get(label, {})}.values()]) for label in wanted]
    for _, gains in tasks:
        require_few(len(gains))
        for gain in gains:
            refuse_ends(experiment, gain)
    return tasks


def _as_given(source: Source, gains: Sequence[Gain]) -> dict[str, float] | None:
    """The gains that are sought as the configuration has them; None where it lacks one."""
    found = {}
    for gain in gains:
        value: object = source.data
        for key in gain.path.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        found[gain.path] = float(value)
    return found


def _tuned(
    cases: Sequence[Case],
    goal: Goal,
    gains: list[Gain],
    budget: int,
    written: dict[str, float] | None,
) -> _Tuned:
    """The best gains of an observer.

    Parameters
    ----------
    written : dict of str to float, optional
        The gains in the file, which are kept where all others are as good.
    """
    others = {f"observers.{label}": None for label in cases[0].experiment.observers if label != goal.label}
    models = any(gain.path.startswith(_OF_PLANT) for gain in gains)
    alone = [
        replace(
            case,
            experiment=case.experiment.varied(others) if others else case.experiment,
            refitted=models and case.samples.given.start_is_fitted and bool(case.experiment.begun.get(goal.label)),
        )
        for case in cases
    ]
    trials = Trials(alone, goal, {gain.path: gain.range for gain in gains}, budget)
    best = search(trials)
    kept = False
    alike = []
    if trials.alike:
        kept = written is not None and trials.as_good(written)
        best = written if kept and written is not None else best
        what = ", ".join(gain.path.split(".", 2)[2] for gain in gains)
        then = "those of the file are kept" if kept else "those that are written are no better than others"
        alike = [f"all candidates are equally good, so that nothing is known of {what}: {then}"]
    held_out, remarks = reported(trials, best)
    spread = {} if trials.alike else standard_errors(trials)
    return _Tuned(
        goal, gains, best, trials.least, held_out, len(trials.tried), budget, [*alike, *remarks], kept, spread
    )


def _warn(one: _Tuned, name: str, base: Experiment) -> None:
    """Gains at an end of their range are reported on stderr, but for those that end at 0 and may be 0."""
    for gain in one.sought:
        if gain.path in one.no_other_than_zero and 0.0 in gain.range.ends:
            continue
        if told := at_an_end(base, gain, one.gains[gain.path]):
            say(f"hgorun: {name}: {told}")


def _tell(found: Sequence[_Tuned], name: str) -> None:
    """Outliers, and scores that tell nothing, are reported on stderr, those of all observers once."""
    of = {words: [one.goal.label for one in found if words in one.remarks] for one in found for words in one.remarks}
    for words, labels in of.items():
        say(f"hgorun: {name}: {', '.join(labels)}: {words}")


def _table(found: Sequence[_Tuned]) -> str:
    goal = found[0].goal
    gains = [{path.split(".", 2)[2]: value for path, value in one.gains.items()} for one in found]
    names = dict.fromkeys(name for one in gains for name in one)
    columns = [[name, *(number(one.get(name)) for one in gains)] for name in names]
    columns += [
        [f"{goal.score} {goal.name}: search", *(number(one.tuned) for one in found)],
        ["held out", *(number(one.held_out) for one in found)],
        ["runs", *(f"{one.runs} of {one.budget}" for one in found)],
    ]
    blocks = packed([one.goal.label for one in found], [[column] for column in columns])
    early = ", ".join(one.goal.label for one in found if one.runs < one.budget)
    why = f"{early}: the search ended before its budget, where gains nearby give the same score"
    lines = [line for one in found for line in _spread(one)] + (wrapped(why) if early else [])
    return "\n\n".join(["\n".join(block) for block in blocks] + (["\n".join(lines)] if lines else []))


def _spread(one: _Tuned) -> list[str]:
    """How well the recordings determine each number, where the model is among them."""
    if not any(path.startswith(_OF_PLANT) for path in one.spread):
        return []
    short = {path: path.split(".", 2)[2] for path in one.spread}
    told = ", ".join(f"{short[path]} {value:.2g}" for path, value in one.spread.items())
    lines = wrapped(f"{one.goal.label}: standard errors: {told}")
    if some := ", ".join(short[path] for path in one.no_other_than_zero):
        lines += wrapped(f"{one.goal.label}: within two of them 0 is as good: {some}")
    return lines


def _as_json(found: Sequence[_Tuned], name: str, target: Path) -> dict[str, object]:
    observers = {
        one.goal.label: {
            "runs": one.runs,
            "budget": one.budget,
            "gains": one.gains,
            "standard_errors": one.spread,
            "no_other_than_zero": one.no_other_than_zero,
            "tuned": {str(one.goal): one.tuned},
            "held_out": {str(one.goal): one.held_out},
        }
        for one in found
    }
    return {"name": name, "files": [str(target)], "observers": observers}
