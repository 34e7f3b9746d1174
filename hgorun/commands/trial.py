"""A first configuration is tried with every observer that was asked for, and changed until its estimates follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import yaml

from hgorun.commands.first import First, number_text
from hgorun.errors import ConfigError, HgorunError
from hgorun.observers.base import OBSERVERS
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate_prepared

FOLLOWS = 0.25  # of what a state moves through: the error of an estimate that follows it
_WELL = 0.1  # and of one for which no better gain is sought
_SPEEDS = 1 / 4, 4, 1 / 16, 16  # times the first gain
_BOUNDS = 10, 1 / 10, 100  # times the first bound of a derivative
_VARIED = {"theta": _SPEEDS, "omega_o": _SPEEDS, "eps": _SPEEDS, "L": _BOUNDS, "G": _BOUNDS, "window": (2, 4)}
_CERTAIN = 1e-2, 1e-4  # times the variances of a Kalman filter, for states that are small
_QUIETER = 1, 1 / 10, 1 / 100  # times the noise
_NEARER = 1, 1 / 10  # times the initial error
_BUDGET = 1_000_000  # evaluations: what takes longer is no first configuration


@dataclass(frozen=True)
class Outcome:
    """How an observer did.

    Attributes
    ----------
    trouble : str or None
        Why its numbers cannot be trusted.
    refused : bool
        Whether it could not even begin, with this first guess.
    error : float
        The root mean square of its error in the last third of the run, over what the state moves through, of the state
        where that is largest.
    """

    trouble: str | None
    refused: bool = False
    error: float = np.inf


@dataclass(frozen=True)
class Found:
    """A configuration, and the error of the observer that follows worst in it.

    Attributes
    ----------
    error : float
        As in an outcome; infinite where an observer does not run.
    first : First
    trouble : str
        What kept the first try from running, if nothing runs.
    changes : sequence of str
        What was answered, why it does not run, and what is written in its place.
    """

    error: float
    first: First
    trouble: str = ""
    changes: Sequence[str] = ()


def followed(first: First, *, answered: bool = False) -> Found:
    """The configuration, with what each observer needs: other gains, a better first guess, less noise, all times.

    Parameters
    ----------
    first : First
    answered : bool
        Whether noise, sampling and first guess are answers, which stay where the observers run with them.
    """
    best, why, first = Found(np.inf, first), "", _with_boxes(first)
    enough = np.inf if answered else FOLLOWS
    for sampled in dict.fromkeys((first.sampled, False)):
        for share in _QUIETER:
            scene = replace(first, sampled=sampled, noise=share)
            chosen = [_best(scene, label, enough) for label in first.start.observers]
            made = _together(scene, [found for _, found, _ in chosen])
            changes = [*_changes(first, made, why), *(told for _, _, told in chosen if told)] if answered else ()
            error = max(outcome.error for outcome, _, _ in chosen)
            best = min(best, Found(error, made, changes=changes), key=lambda found: found.error)
            if best.error < enough:
                return best
            why = why or next((outcome.trouble for outcome, _, _ in chosen if outcome.trouble), "")
            if any(outcome.refused for outcome, _, _ in chosen):
                break  # whatever the noise
    return replace(best, trouble=why or "its estimate is not finite") if best.error == np.inf else best


def _changes(first: First, made: First, why: str) -> Iterator[str]:
    """What is told of the noise and the sampling that are not those of the answers."""
    if made.noise < 1:
        of, other = (number_text(float(f"{share * first.start.noise:.6g}")) for share in (1, made.noise))
        yield f"with noise of standard deviation {of}: {why}; {other} is written in its place"
    if made.sampled != first.sampled:
        yield f"with samples: {why}; what is written has an output that is known at all times"


def _with_boxes(first: First) -> First:
    """With the box of states that some observers need: a little more than where the plant goes."""
    boxes = [
        label
        for label, keys in first.start.observers.items()
        if "box" not in keys and "box" in OBSERVERS.find(str(keys["type"])).model_fields
    ]
    if not boxes:
        return first
    filter_alone = {"EKF": {"type": "ekf", "Q": dict.fromkeys(first.start.initial, 0.01)}}
    try:
        result = _simulated(replace(first, start=replace(first.start, observers=filter_alone)))
    except HgorunError:
        return first
    low, high = result.x.min(axis=0), result.x.max(axis=0)
    margins = np.maximum(0.1 * (high - low), 1e-3)
    ends = np.column_stack([low - margins, high + margins]).tolist()
    box = {state: [float(f"{end:.3g}") for end in two] for state, two in zip(result.states, ends, strict=True)}
    for label in boxes:
        first = first.with_observer(label, {**first.start.observers[label], "box": box, "outside": "saturate"}, None)
    return first


def outcome_of(first: First) -> Outcome:
    """How the only observer of a configuration does."""
    try:
        result = _simulated(first)
    except HgorunError as error:
        return Outcome(error.message if isinstance(error, ConfigError) else str(error), refused=True)
    (observer,) = result.observers.values()
    if observer.unestimated:
        left = ", ".join(observer.unestimated)
        more = f"hgorun show {observer.type} says what it has to be told of the plant"
        return Outcome(
            f"its estimate leaves {left} out, since the equations do not say all it needs; {more}", refused=True
        )
    troubles = result.troubles()
    if not troubles:
        return Outcome(None, error=_error(result))
    at_once = observer.status == "undefined" and observer.status_at == result.time[0]
    return Outcome(troubles[0], refused=at_once)


def _simulated(first: First) -> Result:
    mapping = yaml.safe_load(first.text(""))
    mapping["solver"] = {**mapping.get("solver", {}), "max_evaluations": _BUDGET}
    return simulate_prepared(prepare(Experiment(mapping)))


def _error(result: Result) -> float:
    (observer,) = result.observers.values()
    known = [k for k, state in enumerate(result.states) if state not in observer.unestimated]
    late = result.time >= result.time[-1] - (result.time[-1] - result.time[0]) / 3
    error = np.sqrt(np.mean((observer.xhat - result.x)[late] ** 2, axis=0))
    moved = np.maximum(np.ptp(result.x, axis=0), 0.05 * np.max(np.abs(result.x), axis=0))
    largest = float(np.max((error / np.maximum(moved, np.finfo(float).tiny))[known]))
    return largest if np.isfinite(largest) else np.inf


def _together(scene: First, alone: Sequence[First]) -> First:
    """The scene with the observers of configurations that have one each."""
    for one in alone:
        ((label, keys),) = one.start.observers.items()
        scene = scene.with_observer(label, keys, one.estimates.get(label))
    return scene


def _best(scene: First, label: str, enough: float) -> tuple[Outcome, First, str]:
    """The observer alone: the first variant whose estimate follows well, or the best of them.

    Other first guesses are tried where the error is not below ``enough`` with the one that is meant; with the variant
    comes what is told of its first guess, where that is another one.
    """
    found: list[tuple[Outcome, First, str]] = []
    why = ""
    start, keys = scene.start, scene.start.observers[label]
    for share in _NEARER:
        estimate = {name: value + share * (start.estimate[name] - value) for name, value in start.initial.items()}
        meant, other = _guess(start.estimate), _guess(estimate)
        told = f"{label} from the first guess {meant}: {why}; {other} is written in its place" if share < 1 else ""
        for block in _blocks(keys, sampled=scene.sampled):
            alone = replace(scene, start=replace(start, observers={}), estimates={})
            one = alone.with_observer(label, block, estimate if share < 1 else None)
            outcome = outcome_of(one)
            found.append((outcome, one, told))
            why = why or outcome.trouble or ""
            if outcome.trouble is None and outcome.error < _WELL:
                return found[-1]
            if outcome.refused:
                break  # whatever the gain
        if any(outcome.trouble is None and outcome.error < enough for outcome, _, _ in found):
            break  # from the first guess that is meant
    return min(found, key=lambda one: (one[0].refused, one[0].error))


def _guess(estimate: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {number_text(float(f'{value:.6g}'))}" for name, value in estimate.items())


def _blocks(keys: Mapping[str, object], *, sampled: bool) -> Iterator[Mapping[str, object]]:
    """The block, corrected at samples where it may be, and the same with other gains."""
    fields = OBSERVERS.find(str(keys["type"])).model_fields
    if sampled and "update" in fields and "jump" in str(fields["update"].annotation):
        keys = {**keys, "update": "jump"}
    yield keys
    values = {name: keys.get(name, fields[name].default) for name in _VARIED if name in fields}
    name, value = next(((name, value) for name, value in values.items() if isinstance(value, int | float)), ("", 0))
    for factor in _VARIED[name] if name else ():
        yield {**keys, name: _times(value, factor)}
    if not name and isinstance(weights := keys.get("Q"), Mapping):
        for factor in _CERTAIN:
            small = {state: _times(weight, factor) for state, weight in weights.items()}
            yield {**keys, "Q": small, "internal": {"P": factor}}


def _times(value: object, factor: float) -> float | int:
    """The number times a factor; counts stay counts."""
    assert isinstance(value, int | float)
    return int(value * factor) if isinstance(value, int) and isinstance(factor, int) else value * factor
