"""A first configuration from answers at a terminal."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TypeVar

from hgorun.commands.first import First, first_of, with_observers
from hgorun.config.expressions import CONSTANTS, check_name, nearest, parse
from hgorun.config.time_units import run_unit
from hgorun.errors import HgorunError
from hgorun.plants.base import PLANTS, Input, Start

Answer = TypeVar("Answer")
Named = TypeVar("Named", bound=Collection[str])
_OWN = "own"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def ask() -> First:
    """Ask for a plant, its observers and how it is measured; Enter takes what stands in brackets.

    Raises
    ------
    HgorunError
        When the answers end.
    """
    print("Enter takes what stands in brackets.")
    print(f"Plants: {', '.join(PLANTS.names())}, or {_OWN} for your own equations.")
    name = _answer("plant", "contois", _plant)
    chosen = _own() if name == _OWN else first_of(name, PLANTS.find(name))
    start = replace(chosen.start, inputs=_given_inputs(chosen))
    unit = f", {start.unit}" if start.unit[:1].isalpha() else ""
    end = _answer(f"end of the run{unit}", f"{start.end:g}", _positive)
    period = _answer("sampling period, 0 for an output that is known at all times", f"{start.period:g}", _not_negative)
    noise = _answer("standard deviation of the noise", f"{start.noise:g}", _not_negative)
    types = [str(keys["type"]) for keys in start.observers.values()]
    start = replace(start, end=end, period=period or start.period, noise=noise)
    start = _answer("observers", ", ".join(types), lambda text: _observers(start, text))
    return replace(chosen, start=start, sampled=period > 0)


@dataclass
class _Model:
    """The names of your own plant, as they are told one after another."""

    states: list[str]
    parameters: dict[str, float] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)

    @property
    def known(self) -> set[str]:
        return {*self.states, *self.parameters, *self.inputs, "t"}

    def free(self, text: str, read: Callable[[str], Named]) -> Named:
        """Names that are given to something, none of which has a meaning already."""
        named = read(text)
        taken = next((name for name in named if name in self.known), None)
        if taken is not None:
            raise ValueError(f"{taken} is {'the time' if taken == 't' else 'a name already'}: take another name")
        return named

    def expression(self, question: str, default: str = "") -> str:
        """An expression; of a name that is not known it is asked what that is, and where it is nothing, all again."""
        while True:
            text = _answer(question, default, _expression)
            if all(map(self._is_told, sorted(parse(text).names - self.known))):
                self.texts.append(text)
                return text

    def _is_told(self, name: str) -> bool:
        """Whether an unknown name is a parameter or an input, which it is from then on."""
        print(f"  {name} is not known.{nearest(name, [*self.known, *CONSTANTS])}")
        question = "  Its number, or as an input an expression of t (Enter: write it again)"
        given = _answer(question, "", lambda text: _expression(text, {*self.parameters, "t"}) if text else "")
        if given and parse(given).names:
            self.inputs[name] = given
        elif given:
            self.parameters[name] = parse(given).number()
        return bool(given)

    def used(self) -> dict[str, float]:
        """The parameters that something uses; it is said which are left out."""
        used = {name for text in (*self.texts, *self.inputs.values()) for name in parse(text).names}
        for name in [name for name in self.parameters if name not in used]:
            print(f"  nothing uses the parameter {name}: it is left out", file=sys.stderr)
        return {name: value for name, value in self.parameters.items() if name in used}


def _own() -> First:
    """Your own plant: states, equations, output, parameters, inputs, initial state."""
    unit = _answer("unit of time", "s", lambda text: run_unit(text.strip()))
    model = _Model([])
    model.states = states = _answer("states, with commas between", "x1, x2", lambda text: model.free(text, _names))
    none = "with those that your equations use (Enter: none)"
    model.parameters = _answer(
        f"parameters, such as a = 1, b = 0.5, {none}", "", lambda text: model.free(text, _assignments)
    )
    names = _answer(f"inputs, with commas between, {none}", "", lambda text: model.free(text, _names) if text else [])
    model.inputs = dict.fromkeys(names, "0")
    lines = [f"  states: [{', '.join(states)}]", "  dynamics:"]
    lines += [f'    {state}: "{right}"' for state in states if (right := model.expression(f"{state}' ="))]
    lines.append(f'  output: "{model.expression("output", states[0])}"')
    for name in names:
        model.inputs[name] = _answer(f"{name} =", "sin(t)", lambda text: _expression(text, {*model.parameters, "t"}))
    if model.inputs:
        lines.append("  inputs: {" + ", ".join(f'{name}: "{text}"' for name, text in model.inputs.items()) + "}")
    if parameters := model.used():
        lines.append("  parameters: {" + ", ".join(f"{k}: {v:g}" for k, v in parameters.items()) + "}")
    initial = {state: _answer(f"{state} at the start", "1", _number) for state in states}
    estimate = {state: _answer(f"first guess of {state}", "0", _number) for state in states}
    start = Start(
        end=10,
        unit=unit,
        initial=initial,
        estimate=estimate,
        period=0.1,
        noise=0.01,
        observers={"SHGO": {"type": "shgo", "theta": 3}},
    )
    return First(name="my_plant", meaning="a plant of your own", plant=lines, start=start)


def _given_inputs(chosen: First) -> dict[str, str]:
    """Those of a plant that is built in."""
    found = {}
    for name, text in chosen.start.inputs.items():
        known = chosen.inputs.get(name, Input())
        about = ", ".join(filter(None, (known.meaning, known.unit)))
        question = f"input {name}{about and f' ({about})'}, a number or an expression of t"
        found[name] = _answer(question, text, lambda text: _expression(text, {*chosen.parameters, "t"}))
    return found


def _answer(question: str, default: str, read: Callable[[str], Answer]) -> Answer:
    """What is answered to a question, which is asked again until the answer can be read."""
    while True:
        try:
            text = input(f"{question} [{default}]: " if default else f"{question} ")
        except EOFError:
            raise HgorunError("the answers ended; nothing is written") from None
        try:
            return read(text.strip() or default)
        except (ValueError, HgorunError) as error:
            print(f"  {error}", file=sys.stderr)


def _plant(text: str) -> str:
    if text != _OWN and text not in PLANTS.names():
        raise ValueError(f"no plant is called {text!r}.{nearest(text, [*PLANTS.names(), _OWN])}")
    return text


def _observers(start: Start, text: str) -> Start:
    types = [part.strip() for part in text.split(",") if part.strip()]
    if not types:
        raise ValueError("name one observer at least; hgorun list observers has all of them")
    if types == [keys["type"] for keys in start.observers.values()]:
        return start
    return with_observers(start, types)


def _names(text: str) -> list[str]:
    names = [part.strip() for part in text.split(",")]
    if not all(map(_NAME.fullmatch, names)) or len(set(names)) < len(names):
        raise ValueError(f"expected different names with commas between, such as x1, x2; found {text!r}")
    for name in names:
        check_name(name)
    return names


def _assignments(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in text.split(",") if text else ():
        name, sign, value = part.partition("=")
        if not sign or not _NAME.fullmatch(name.strip()):
            raise ValueError(f"expected name = number, found {part.strip()!r}")
        check_name(name.strip())
        found[name.strip()] = _number(value)
    return found


def _expression(text: str, known: set[str] | None = None) -> str:
    if not text:
        raise ValueError("expected an expression, such as -x1 + sin(t)")
    parse(text, names=known)
    return text


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"expected a number, found {text.strip()!r}")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise ValueError(f"expected a number > 0, found {text}")
    return value


def _not_negative(text: str) -> float:
    value = _number(text)
    if value < 0:
        raise ValueError(f"expected a number >= 0, found {text}")
    return value
