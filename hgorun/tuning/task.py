"""What is tuned: the gains of an observer, what they are to minimise and what has to hold besides."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.config.expressions import ExpressionError
from hgorun.config.nearest import listed, nearest
from hgorun.config.tuning import Bound, Range, Tune, require_few
from hgorun.config.types import SEEDS
from hgorun.ensemble.members.members import written_out
from hgorun.errors import ConfigError, KeyPath, Problem
from hgorun.result.metrics.base import all_metrics
from hgorun.result.metrics.smoothness import HF, nothing_moves
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.windows import MetricSettings
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.timeline.grid import metric_step
from hgorun.study.sentences import Sentence, read_sentence
from hgorun.tuning.gain import Gain, refuse_ends, refuse_unasked

Floats = NDArray[np.float64]
ALL = "*"
# a label without quotes before the first comma of a call; what claims want is in quotes
_UNQUOTED = re.compile(r"\b([A-Za-z_]\w*)\s*\(\s*([^'\",()]+?)\s*,")


@dataclass(frozen=True)
class Limit:
    """A quantity whose mean has to be below, or above, a number."""

    text: str
    sentence: Sentence
    bound: float
    below: bool

    def excess(self, mean: Floats) -> Floats:
        """By how much it is missed, relative to the bound; 0 where it holds."""
        over = mean - self.bound if self.below else self.bound - mean
        return np.where(np.isfinite(over), np.maximum(over, 0.0) / (abs(self.bound) or 1.0), np.inf)


@dataclass(frozen=True, eq=False)
class Task:
    """The search for one observer.

    Attributes
    ----------
    label : str
        Whose gains are sought, or what the task is called where they belong to several or none.
    base : Experiment
        With the observers alone that the quantities name.
    gains : tuple of Gain
    goals : tuple of (str, Sentence)
        What is minimised, as it was written.
    limits : tuple of Limit
    seeds, held_out : tuple of int
    budget : int
        Runs that the search may take.
    """

    label: str
    base: Experiment
    gains: tuple[Gain, ...]
    goals: tuple[tuple[str, Sentence], ...]
    limits: tuple[Limit, ...]
    seeds: tuple[int, ...]
    held_out: tuple[int, ...]
    budget: int

    @property
    def sentences(self) -> tuple[Sentence, ...]:
        """Of goals and limits."""
        return (*(sentence for _, sentence in self.goals), *(limit.sentence for limit in self.limits))


def is_plain(sentence: Sentence) -> bool:
    """Whether it is one quantity, and no expression of any."""
    return len(sentence.quantities) == 1 and sentence.expression.text.strip() == "q0"


def tasks(experiment: Experiment, tune: Tune) -> list[Task]:
    """One task, or one for each observer where quantities are of ``*``.

    Raises
    ------
    Problem
        At ("tune", key, ...), where names or paths do not exist, a quantity is no metric, a gain has no effect on what
        is minimised, observers would get different numbers of gains, or the budget is too small for the seeds.
    """
    found = _tasks(experiment, tune)
    tune.require_enough()  # a wrong name is no less wrong for it
    return found


def _tasks(experiment: Experiment, tune: Tune) -> list[Task]:
    wanted = [*tune.minimise, *(bound.value for bound in tune.subject)]
    if not any(_of_all(text) for text in wanted):
        paths = [(path, key) for key in tune.gains for path in _paths(experiment, key)]
        return [_task(experiment, tune, "", paths)]
    found: dict[str, list[tuple[str, str]]] = {}
    for key in tune.gains:
        for path in _paths(experiment, key):
            label = _observer_of(path, experiment)
            if label is None:
                raise Problem(("tune", "gains", key), "where quantities are of *, gains are those of observers")
            found.setdefault(label, []).append((path, key))
    numbers = {label: len(paths) for label, paths in found.items()}
    if len(set(numbers.values())) > 1:
        told = ", ".join(f"{label} {n}" for label, n in numbers.items())
        raise Problem(("tune", "gains"), f"observers are compared with equally many gains; found {told}")
    return [_task(experiment, tune, label, paths) for label, paths in found.items()]


def _paths(experiment: Experiment, key: str) -> list[str]:
    try:
        return written_out(experiment, key)
    except ConfigError as error:
        raise Problem(("tune", "gains", key), error.message) from None


def _observer_of(path: str, experiment: Experiment) -> str | None:
    """Whose key a path is."""
    labels = [label for label in experiment.observers if path.startswith(f"observers.{label}.")]
    return max(labels, key=len, default=None)


def _of_all(text: str) -> bool:
    return re.search(r"\(\s*'?\*'?\s*,", text) is not None


def _task(experiment: Experiment, tune: Tune, label: str, paths: Sequence[tuple[str, str]]) -> Task:
    require_few(len(paths))
    goals = tuple(
        (_named(text, label), _sentence(text, label, experiment, ("tune", "minimise", i)))
        for i, text in enumerate(tune.minimise)
    )
    limits = tuple(_limit(bound, label, experiment, i) for i, bound in enumerate(tune.subject))
    named = {q.of[0][1] for _, s in goals for q in s.quantities}
    named |= {q.of[0][1] for limit in limits for q in limit.sentence.quantities}
    for path, key in paths:
        whose = _observer_of(path, experiment)
        if whose is not None and whose not in named:
            refuse_unasked(key, whose)
    others = {f"observers.{one}": None for one in experiment.observers if one not in named}
    base = experiment.varied(others) if others else experiment
    first, count = base.blocks.seed, tune.seeds + tune.held_out
    if first + count > SEEDS:
        what = f"{count} seeds from {first} on, those held out among them, end above the largest seed, {SEEDS - 1}"
        raise Problem(("tune", "seeds"), what)
    return Task(
        label=label or ", ".join(sorted(str(one) for one in named)),
        base=base,
        gains=tuple(_gain(base, path, key, tune.gains[key]) for path, key in paths),
        goals=goals,
        limits=limits,
        seeds=tuple(range(first, first + tune.seeds)),
        held_out=tuple(range(first + tune.seeds, first + tune.seeds + tune.held_out)),
        budget=tune.runs(len(paths)),
    )


def _gain(base: Experiment, path: str, key: str, given: Range) -> Gain:
    """A gain, both ends of whose range are admissible."""
    gain = Gain(path, given, key)
    refuse_ends(base, gain)
    return gain


def _limit(bound: Bound, label: str, experiment: Experiment, i: int) -> Limit:
    sentence = _sentence(bound.value, label, experiment, ("tune", "subject", i, "value"))
    below = bound.below is not None
    return Limit(_named(bound.value, label), sentence, float((bound.below if below else bound.above) or 0.0), below)


def _named(text: str, label: str) -> str:
    """A quantity as claims write it: names in quotes, and the observer's for ``*``."""
    quoted = _UNQUOTED.sub(lambda match: f"{match[1]}('{match[2]}',", text)
    return quoted.replace("'*'", f"'{label}'") if label else quoted


def _sentence(text: str, label: str, experiment: Experiment, place: KeyPath) -> Sentence:
    try:
        sentence = read_sentence(_named(text, label), (experiment.name,))
    except ExpressionError as error:
        raise Problem(place, str(error)) from None
    for quantity in sentence.quantities:
        _check(quantity, experiment, place)
    return sentence


def _check(quantity: Quantity, experiment: Experiment, place: KeyPath) -> None:
    label, states = quantity.of[0][1], experiment.plant.model.states
    known = all_metrics(closed=experiment.closed)
    if quantity.function not in known or quantity.window is not None:
        raise Problem(place, f"{quantity}: only metrics without a window can be tuned: {', '.join(known)}")
    blocks = experiment.blocks
    average, step = MetricSettings.of(blocks.metrics, blocks.time).average, metric_step(blocks.time, blocks.metrics)
    if quantity.function == HF.name and nothing_moves(average, step):
        told = (
            f"{quantity}: hf is 0 for all gains, as its moving mean of {average:g} is no longer than a step of {step:g}"
        )
        raise Problem(place, f"{told}: set metrics.average to more, or time.output_step to less")
    if label not in experiment.observers:
        near = nearest(label or "", experiment.observers)
        raise Problem(
            place, f"no observer is called {label!r}.{near} Known: {listed(experiment.observers, label or '')}"
        )
    if quantity.state not in states:
        near = nearest(quantity.state or "", states)
        raise Problem(
            place, f"the plant has no state {quantity.state!r}.{near} Known: {listed(states, quantity.state or '')}"
        )
