"""A first configuration of a plant as YAML with comments."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.commands.described import own_doc
from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS, AnyObserver
from hgorun.observers.capabilities import Switching
from hgorun.observers.kalman import KalmanFilter
from hgorun.plants.base import PLANTS, Input, Parameter, Plant, Start, units_of

_POINTS = 1000  # of the output grid, at least
_WIDTH = 100
_DRIFT = 0.1  # of a state in this part of a run
_PLAIN = re.compile(r"[A-Za-z]([A-Za-z0-9_ ]*[A-Za-z0-9_])?")  # text without meaning for YAML


@dataclass(frozen=True, kw_only=True)
class First:
    """What a first configuration has.

    Attributes
    ----------
    name : str
        Of its file and its title.
    meaning : str
        What the plant is, in a line.
    plant : sequence of str
        The lines of the plant's block, without what follows from ``start``.
    start : Start
    sampled : bool
        Whether the output is known at samples only.
    noise : float
        Times that of ``start``: less than 1 for observers that it would swamp.
    estimates : mapping of str to mapping
        First guesses of observers that need another one than that of ``start``, by label.
    parameters, inputs : mapping
        Those of the plant, with units and meanings.
    """

    name: str
    meaning: str
    plant: Sequence[str]
    start: Start
    sampled: bool = True
    noise: float = 1
    estimates: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    inputs: Mapping[str, Input] = field(default_factory=dict)

    def text(self, file: str) -> str:
        """The configuration, for a file of this name."""
        start, end = self.start, number_text(self.start.end)
        third, step = number_text(float(f"{start.end / 3:.2g}")), number_text(_rounded(start.end / _POINTS))
        blocks = [
            self._head(file),
            [f"title: {_text(f'{self.name}, a first configuration')}"],
            [
                f"# All times and rates are in this unit. Output every {step}.",
                f"time: {{end: {end}, output_step: {step}, unit: {_text(start.unit)}}}",
            ],
            self._plant(),
            self._measurement(),
            self._observers(),
            [
                "seed: 0  # of the noise; --seed changes it for one run",
                "metrics:",
                f"  transient: [0, {third}]  # where peaks are looked for",
                f"  window: [{third}, {end}]  # where the steady error is measured",
            ],
            self._solver(),
        ]
        return "\n\n".join("\n".join(block) for block in blocks) + "\n"

    def with_observer(self, label: str, keys: Mapping[str, object], estimate: Mapping[str, float] | None) -> First:
        """The same with other keys of an observer, and another first guess where one is given."""
        observers = {**self.start.observers, label: keys}
        estimates = self.estimates if estimate is None else {**self.estimates, label: estimate}
        return replace(self, start=replace(self.start, observers=observers), estimates=estimates)

    def _solver(self) -> list[str]:
        """The method, which is chosen unless an observer has no solution to which shorter steps would lead."""
        if any(issubclass(OBSERVERS.find(str(keys["type"])), Switching) for keys in self.start.observers.values()):
            step = number_text(_rounded(self.start.end / _POINTS / 20))
            return [f"solver: {{method: euler, step: {step}}}  # sliding modes have no limit as steps get shorter"]
        return ["# solver: {method: rk4, step: 1.0e-3}  # by default the method and the step are chosen for you"]

    def _head(self, file: str) -> list[str]:
        return [
            *_comment(f"A first configuration of {self.name}: {self.meaning}"),
            "#",
            f"#     hgorun simulate {file}    numbers: errors, peaks, settling times, what noise does",
            f"#     hgorun compare {file}     the same with pictures, in results/",
            f"#     hgorun analyze {file}     what theory says: limits, margins, which gain to change",
            "#",
            *_comment("hgorun show NAME describes a plant, an observer, a kind of noise. Comments may be left out."),
        ]

    def _plant(self) -> list[str]:
        lines = ["plant:", *self.plant]
        if self.parameters:
            lines.append("  parameters:")
            for name, parameter in self.parameters.items():
                value = 1.0 if parameter.default is None else parameter.default
                lines.append(_beside(f"    {name}: {number_text(value)}", f"{parameter.meaning}, {parameter.unit}"))
        if self.start.inputs:
            lines.append("  inputs:  # expressions of the time t; observers know them")
            for name, text in self.start.inputs.items():
                known = self.inputs.get(name, Input())
                lines.append(_beside(f"    {name}: {text}", f"{known.meaning}, {known.unit}"))
        return [*lines, f"  initial: {_mapping(self.start.initial)}  # the true state, which observers do not know"]

    def _measurement(self) -> list[str]:
        period = number_text(self.start.period)
        noise = number_text(self.start.noise if self.noise == 1 else _rounded(self.start.noise * self.noise))
        little = "" if self.noise == 1 else "  # little, since an observer below takes it for the signal"
        hold = "" if self.sampled else f", hold: {period}"
        return [
            "# What observers get of the plant. Without sampling the output is known at all times.",
            "measurement:",
            f"  {'' if self.sampled else '# '}sampling: {{period: {period}}}",
            f"  # delay: {period}  # samples that come late",
            f"  noise: [{{type: gaussian, std: {noise}{hold}}}]{little}",
        ]

    def _observers(self) -> list[str]:
        lines = ["# One block each, under a label of your own. theta is the gain: faster and noisier as it grows."]
        lines.append("observers:")
        for label, keys in self.start.observers.items():
            lines += [f"  {_text(label)}:", _beside(f"    type: {keys['type']}", _meaning(str(keys["type"])))]
            lines += [f"    {key}: {_value(value)}" for key, value in keys.items() if key not in ("type", "initial")]
            lines.append(f"    initial: {_mapping(self.estimates.get(label, self.start.estimate))}  # the first guess")
        return lines


def first_of(name: str, cls: type[Plant], observers: Sequence[str] = ()) -> First:
    """The first configuration of a plant.

    Parameters
    ----------
    name : str
    cls : type
        The plant's class.
    observers : sequence of str
        Types; where there are none, those that the plant names.

    Raises
    ------
    ConfigError
        For observers that do not exist.
    """
    start = cls.first or _guessed(cls)
    chosen = with_observers(start, observers) if observers else start
    meaning = own_doc(cls).split("\n\n")[0].replace("\n", " ")
    lines = [_beside(f"  type: {name}", "; ".join(_units(cls)))]
    lines += [f"  {key}: {_value(value)}" for key, value in chosen.keys.items()]
    return First(
        name=name, meaning=meaning, plant=lines, start=chosen, parameters=cls.known_parameters, inputs=cls.known_inputs
    )


def with_observers(start: Start, types: Sequence[str]) -> Start:
    """The same with other observers: their labels are their types in capitals, keys those of their examples."""
    blocks: dict[str, dict[str, object]] = {}
    for name in types:
        try:
            cls = OBSERVERS.find(name)
        except KeyError:
            hint = nearest(name, OBSERVERS.names())
            plant = f" It is a plant: --plant {name}" if name in PLANTS.names() else ""
            advice = plant or f"{hint} See hgorun list observers"
            raise ConfigError(f"no observer is called {name!r}.{advice}", key="--observer") from None
        known = next((keys for keys in start.observers.values() if keys["type"] == name), None)
        example = {**_example(cls, start), **start.told.get(name, {})}
        gain = cls.model_fields.get("theta")
        theta = {"theta": 5} if gain is not None and gain.is_required() else {}
        blocks[name.upper()] = dict(known) if known is not None else {"type": name, **theta, **example}
    return replace(start, observers=blocks)


def _example(cls: type[AnyObserver], start: Start) -> dict[str, object]:
    """The keys that a type needs; those of the noise follow from what is known of the plant and the measurement."""
    example = dict(cls.example(tuple(start.initial)))
    if not issubclass(cls, KalmanFilter):
        return example
    if "Q" in example:
        example["Q"] = _uncertain(start)
    if cls.of_samples and start.noise:
        example.pop("R", None)  # it is that of the noise
    return example


def _uncertain(start: Start) -> dict[str, float]:
    """Densities of process noise with which the model may drift by a tenth of a state in a tenth of the run."""
    sizes = {name: max(abs(value), abs(start.estimate[name] - value)) or 1.0 for name, value in start.initial.items()}
    return {name: float(f"{(_DRIFT * size) ** 2 / (_DRIFT * start.end):.1g}") for name, size in sizes.items()}


def _guessed(cls: type[Plant]) -> Start:
    """For a plant that names no start: that of its example, else numbers near one, and a Kalman filter."""
    example = dict(cls.example())
    block = cls.model_construct()
    names = block.state_names
    near = dict(zip(names, np.linspace(0.5, 1.0, len(names)).round(3).tolist(), strict=True))
    given, inputs = example.get("initial"), example.get("inputs")
    initial = {str(k): float(v) for k, v in given.items()} if isinstance(given, dict) else near
    return Start(
        end=10,
        initial=initial,
        estimate={name: round(0.9 * value, 6) for name, value in initial.items()},
        inputs={str(k): str(v) for k, v in inputs.items()}
        if isinstance(inputs, dict)
        else dict.fromkeys(cls.known_inputs, "0.1"),
        period=0.1,
        noise=0.01,
        observers={"EKF": {"type": "ekf", "Q": dict.fromkeys(names, 0.01)}},
    )


def _units(cls: type[Plant]) -> list[str]:
    """What is said beside a plant's type."""
    units = ", ".join(f"{name} in {unit}" for name, unit in units_of(cls).items() if unit)
    return [part for part in (cls.valid, units) if part]


def _meaning(observer: str) -> str:
    return own_doc(OBSERVERS.find(observer)).split("\n\n")[0].replace("\n", " ")


def _beside(line: str, comment: str) -> str:
    """A line with a comment, which stands above it where there is no room beside it."""
    comment = comment.strip(", ")
    if not comment:
        return line
    indent = line[: len(line) - len(line.lstrip())]
    return f"{line}  # {comment}" if len(line) + len(comment) + 4 <= _WIDTH else f"{indent}# {comment}\n{line}"


def _comment(words: str) -> list[str]:
    return textwrap.wrap(words, _WIDTH, initial_indent="# ", subsequent_indent="# ")


def number_text(value: float) -> str:
    """As YAML and people read it, with all digits that it has."""
    text = next((text for text in (f"{value:.6g}", f"{value:.15g}") if float(text) == value), repr(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _rounded(value: float) -> float:
    """What was computed, in few digits."""
    return float(f"{value:.6g}")


def _mapping(values: Mapping[str, float]) -> str:
    return "{" + ", ".join(f"{name}: {number_text(value)}" for name, value in values.items()) + "}"


def _value(value: object) -> str:
    """A value in one line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_value(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return number_text(value) if isinstance(value, (int, float)) else _text(str(value))


def _text(words: str) -> str:
    """A text as YAML takes it, in quotes where it needs some."""
    plain = words.replace("_", "a").replace(" ", "a").replace(",", "a").replace("'", "a")
    return (
        words
        if plain.isalnum() and not words[0].isdigit() and "," not in words
        else '"' + words.replace('"', "'") + '"'
    )
