"""What of a configuration can be varied on a page: a name, a range, and the values in the file that it stands for."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from hgorun.config.expressions import ExpressionError
from hgorun.config.paths import at
from hgorun.config.types import number
from hgorun.errors import ConfigError
from hgorun.explore.target import NONE, Plain, Target
from hgorun.measurement.blocks import Availability, Measurement, Periodic, Phase
from hgorun.noise.base import Noise, RandomNoise
from hgorun.noise.expression import ExpressionNoise
from hgorun.noise.sinusoids import Sinusoids
from hgorun.noise.uniform import UniformNoise
from hgorun.observers.base import AnyObserver
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.keys import Keys
from hgorun.simulation.experiment.experiment import Experiment

Scale = Literal["linear", "log", "integer"]
_FACTOR = 10.0  # a value is varied between a tenth of that in the file and ten times that
_MOST_FACTOR = 5.0  # of noise and of initial errors
_SEEDS, _MORE = 100, 5  # seeds, and what a whole number grows by
_ALWAYS = ("theta", "r", "poles")  # varied also where the file leaves them to their defaults


@dataclass(frozen=True)
class Knob:
    """One thing that can be varied.

    Attributes
    ----------
    name : str
        In addresses: the path of what it sets, or one like it.
    label : str
        What it is, beside the heading of its group.
    group : str
        An observer's label, or ``measurement``, ``run``.
    scale : {"linear", "log", "integer"}
        How a slider goes from low to high.
    low, high : float
        Between which a slider goes; other values can be typed.
    start : float
        The value in the file.
    targets : tuple of Target
        What it sets.
    unit : str
    """

    name: str
    label: str
    group: str
    scale: Scale
    low: float
    high: float
    start: float
    targets: tuple[Target, ...]
    unit: str = ""

    def changes(self, value: float, others: Mapping[str, Plain] = NONE) -> dict[str, Plain]:
        """What the configuration has by path when the knob has a value, with that of others; nothing at the file's."""
        if value == self.start:
            return {}
        if self.scale == "integer":
            return {target.path: round(value) for target in self.targets}
        return {target.path: target.value(value, others.get(target.path)) for target in self.targets}

    def checked(self, value: object) -> float:
        """A value that has come from a page or an address; as in the file, it may be an expression of numbers.

        Raises
        ------
        ConfigError
        """
        try:
            found = number(value)
        except (ValueError, ExpressionError) as error:
            words = f"expected a number or an expression of numbers, such as 0.5 or pi/4: {error}"
            raise ConfigError(words, key=self.name) from error
        if self.scale == "integer" and found != round(found):
            raise ConfigError(f"expected a whole number, found {found:g}", key=self.name)
        return found


def knobs_of(experiment: Experiment) -> tuple[Knob, ...]:
    """Everything in a configuration that a page can vary: of each observer, of the measurement, and the seed."""
    found: list[Knob] = []
    for label, observer in experiment.observers.items():
        found += of_gains(experiment.source.data["observers"][label], label, observer)
        found += _initial_error(experiment, label, observer)
    found += _of_measurement(experiment)
    seed = experiment.blocks.seed
    if any(isinstance(noise, RandomNoise) for _, noise, _ in _noises(experiment.measurement)) or _by_chance(experiment):
        high = float(max(_SEEDS, seed + _SEEDS))
        found.append(Knob("seed", "seed", "run", "integer", 0.0, high, float(seed), (Target("seed"),)))
    return tuple(found)


def of_gains(
    given: Mapping[str, Any], label: str, observer: AnyObserver, tuned: Collection[str] = ()
) -> Iterator[Knob]:
    """The gains of an observer: those that its block gives, those by which most are tuned, those that this file seeks.

    Parameters
    ----------
    given : mapping
        The block as it is written.
    tuned : collection of str
        Keys that are shown also where the block leaves them to their defaults.
    """
    shown = {*given, *_ALWAYS, *tuned}
    others = (name for name in type(observer).model_fields if name not in _ALWAYS)
    for name in (*(name for name in _ALWAYS if name in type(observer).model_fields), *others):
        if name in Keys.model_fields or name not in shown:
            continue
        path, value = f"observers.{label}.{name}", getattr(observer, name)
        if name == "poles" and value is not None:
            if not isinstance(observer, PlacedGain) or observer.poles_given:
                yield from _poles(path, label, value)
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield of_number(path, name, label, value, _limits(observer, name))
        elif isinstance(value, tuple) and isinstance(given.get(name), list):
            for i, part in enumerate(value):
                if isinstance(part, float):
                    yield of_number(f"{path}.{i}", f"{name} {i + 1}", label, part)
        elif isinstance(given.get(name), dict):
            for key, part in given[name].items():
                if isinstance(part, (int, float)) and not isinstance(part, bool):
                    yield of_number(f"{path}.{key}", f"{name} {key}", label, float(part))


def of_number(
    path: str,
    label: str,
    group: str,
    value: float,
    limits: tuple[float, float] = (-math.inf, math.inf),
    unit: str = "",
) -> Knob:
    """A knob for one number of the file, over a range around it within what its key admits."""
    low, high = limits
    if isinstance(value, int):
        bottom, top = max(low, min(value - _MORE, 0) if value < 0 else 0), min(high, max(2 * value, value + _MORE))
        return Knob(path, label, group, "integer", float(bottom), float(top), float(value), (Target(path),), unit)
    if value == 0:
        bottom, top, scale = max(low, 0.0 if low >= 0 else -1.0), min(high, 1.0), "linear"
    elif value > 0:
        bottom, top, scale = max(low, value / _FACTOR), min(high, value * _FACTOR), "log"
    else:
        bottom, top, scale = max(low, value * _FACTOR), min(high, value / _FACTOR), "log"
    return Knob(path, label, group, scale, bottom, top, value, (Target(path),), unit)  # type: ignore[arg-type]  # one of Scale


def _limits(observer: AnyObserver, name: str) -> tuple[float, float]:
    """Between what a key's value may be, by its declaration; what only has a limit may come close to it."""
    rules = type(observer).model_fields[name].metadata  # each has one of these attributes
    low = [float(v) for rule in rules for key in ("ge", "gt") if (v := getattr(rule, key, None)) is not None]
    high = [float(v) for rule in rules for key in ("le", "lt") if (v := getattr(rule, key, None)) is not None]
    return max(low, default=-math.inf), min(high, default=math.inf)


def _poles(path: str, group: str, value: complex | tuple[complex, ...]) -> Iterator[Knob]:
    """A pole each; where some are complex, how many times as fast they all are."""
    several = value if isinstance(value, tuple) else (value,)
    if any(pole.imag for pole in several):
        target = Target(path, poles=several)
        label = "poles, times the file's"
        yield Knob(path, label, group, "log", 1 / _FACTOR, _FACTOR, 1.0, (target,))
    else:
        for i, pole in enumerate(several):
            place = (f"{path}.{i}", f"pole {i + 1}") if isinstance(value, tuple) else (path, "poles")
            yield of_number(*place, group, pole.real)


def _initial_error(experiment: Experiment, label: str, observer: AnyObserver) -> Iterator[Knob]:
    """How many times the initial error of the file: towards the truth, and away from it."""
    targets = []
    for name, truth in zip(experiment.plant.model.states, experiment.plant.initial, strict=True):
        error = float(observer.initial.get(str(name), 0.0)) - float(truth)
        if error:
            targets.append(Target(f"observers.{label}.initial.{name}", error, float(truth)))
    if targets:
        name = f"observers.{label}.initial error"
        yield Knob(name, "initial error, times the file's", label, "linear", 0.0, _MOST_FACTOR, 1.0, tuple(targets))


def _of_measurement(experiment: Experiment) -> Iterator[Knob]:
    time = experiment.blocks.time
    span = time.end - time.start
    for path, where, block in _availabilities(experiment.measurement):
        if isinstance(block.sampling, Periodic):
            sampling, here = block.sampling, f"{path}.sampling"
            yield of_number(f"{here}.period", f"period{where}", "measurement", sampling.period, (0, span), time.unit)
            given = at(experiment.source.data, _keys(experiment, path))["sampling"]
            if "jitter" in given:
                yield of_number(
                    f"{here}.jitter", f"jitter{where}", "measurement", sampling.jitter, (0, span), time.unit
                )
            if "dropout" in given:
                yield Knob(
                    f"{here}.dropout", f"dropout{where}", "measurement", "linear", 0.0, 1.0, sampling.dropout,
                    (Target(f"{here}.dropout"),),
                )  # fmt: skip
        delay = None if block.delay is None else _constant(block.delay)
        if delay is not None:
            name, top = f"{path}.delay", 4 * delay or span / _FACTOR
            label = f"delay{where}"
            yield Knob(name, label, "measurement", "linear", 0.0, top, delay, (Target(name),), time.unit)
    for path, noise, whose in _noises(experiment.measurement):
        yield from _noise(path, noise, whose)


def _noise(path: str, noise: Noise, whose: str) -> Iterator[Knob]:
    """How large noise is: in its own unit where one number says so, else how many times as in the file."""
    scaled = noise.scaled_by if isinstance(noise, RandomNoise) else None
    size = getattr(noise, scaled, None) if scaled is not None else None
    if scaled is not None and isinstance(size, float):
        top = _MOST_FACTOR * size or 1.0
        yield Knob(f"{path}.{scaled}", scaled + whose, "measurement", "linear", 0.0, top, size,
                   (Target(f"{path}.{scaled}"),))  # fmt: skip
        return
    decibels = getattr(noise, "snr_db", None)
    if isinstance(decibels, float):
        yield Knob(f"{path}.snr_db", f"signal-to-noise ratio{whose}", "measurement", "linear", decibels - 20,
                   decibels + 20, decibels, (Target(f"{path}.snr_db"),), "dB")  # fmt: skip
        return
    targets: tuple[Target, ...] = ()
    if isinstance(noise, Sinusoids):
        targets = tuple(Target(f"{path}.terms.{i}.amplitude", float(t.amplitude)) for i, t in enumerate(noise.terms))
    elif isinstance(noise, UniformNoise):
        targets = Target(f"{path}.low", float(noise.low)), Target(f"{path}.high", float(noise.high))
    elif isinstance(noise, ExpressionNoise):
        targets = (Target(f"{path}.value", expression=str(noise.value)),)
    if targets:
        label = f"level{whose}, times the file's"
        yield Knob(f"{path}.level", label, "measurement", "linear", 0.0, _MOST_FACTOR, 1.0, targets)


def _availabilities(measurement: Measurement) -> Iterator[tuple[str, str, Availability]]:
    """Every block that says how outputs reach the observers: its path, whose it is, the block."""
    blocks: list[tuple[str, str, Measurement | Phase]] = [("measurement", "", measurement)]
    blocks += [(f"measurement.phases.{i}", f" in phase {i + 1}", one) for i, one in enumerate(measurement.phases)]
    for path, where, block in blocks:
        yield path, where, block
        for name, output in block.outputs.items():
            yield f"{path}.outputs.{name}", f" of {name}{where}", output


def _noises(measurement: Measurement) -> Iterator[tuple[str, Noise, str]]:
    """Every noise: its path, the noise, and whose it is; counted where an output has several."""
    for path, where, block in _availabilities(measurement):
        several = len(block.noise or ()) > 1
        for i, noise in enumerate(block.noise or ()):
            name = f" of noise {i + 1}" if several else " of noise" if where else " of the noise"
            yield f"{path}.noise.{i}", noise, name + where


def _by_chance(experiment: Experiment) -> bool:
    """Whether samples drop out or move at random."""
    sampled = [block.sampling for _, _, block in _availabilities(experiment.measurement)]
    return any(isinstance(s, Periodic) and (s.jitter > 0 or s.dropout > 0) for s in sampled)


def _keys(experiment: Experiment, path: str) -> tuple[str | int, ...]:
    """A path's keys, as long as they stand in the file."""
    found: list[str | int] = []
    here: Any = experiment.source.data
    for key in path.split("."):
        place: str | int = int(key) if isinstance(here, list) else key
        here = here[place]
        found.append(place)
    return tuple(found)


def _constant(text: str) -> float | None:
    """The number that an expression is; None where it is none."""
    try:
        return number(text)
    except (ValueError, ExpressionError):
        return None


def by_name(knobs: tuple[Knob, ...]) -> Mapping[str, Knob]:
    """Knobs by their names."""
    return {knob.name: knob for knob in knobs}
