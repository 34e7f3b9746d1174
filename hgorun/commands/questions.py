"""A first configuration from answers at a terminal."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from hgorun.commands.first import First, first_of, with_observers
from hgorun.config.expressions import nearest, parse
from hgorun.errors import HgorunError
from hgorun.plants.base import PLANTS, Start

Answer = TypeVar("Answer")
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
    start = chosen.start
    end = _answer(f"end of the run, {start.unit}", f"{start.end:g}", _positive)
    period = _answer("sampling period, 0 for an output that is known at all times", f"{start.period:g}", _not_negative)
    noise = _answer("standard deviation of the noise", f"{start.noise:g}", _not_negative)
    types = [str(keys["type"]) for keys in start.observers.values()]
    start = replace(start, end=end, period=period or start.period, noise=noise)
    start = _answer("observers", ", ".join(types), lambda text: _observers(start, text))
    return replace(chosen, start=start, sampled=period > 0)


def _own() -> First:
    """Your own plant: states, equations, output, parameters, inputs, initial state."""
    unit = _answer("unit of time", "s", str.strip)
    states = _answer("states, with commas between", "x1, x2", _names)
    parameters = _answer("parameters, such as a = 1, b = 0.5 (Enter: none)", "", _assignments)
    names = _answer("inputs, with commas between (Enter: none)", "", lambda text: _names(text) if text else [])
    known = {*states, *parameters, *names, "t"}
    lines = [f"  states: [{', '.join(states)}]", "  dynamics:"]
    right_hand_sides = []
    for state in states:
        right = _answer(f"{state}' =", "", lambda text: _expression(text, known))
        right_hand_sides.append(right)
        lines.append(f'    {state}: "{right}"')
    output = _answer("output", states[0], lambda text: _expression(text, known))
    lines.append(f'  output: "{output}"')
    texts = [*right_hand_sides, output]
    if names:
        functions = {
            name: _answer(f"{name} =", "sin(t)", lambda text: _expression(text, {*parameters, "t"})) for name in names
        }
        lines.append("  inputs: {" + ", ".join(f'{name}: "{text}"' for name, text in functions.items()) + "}")
        texts += functions.values()
    used = {name for text in texts for name in parse(text).names}
    for name in [name for name in parameters if name not in used]:
        del parameters[name]
        print(f"  nothing uses the parameter {name}: it is left out", file=sys.stderr)
    if parameters:
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
    wrong = next((name for name in names if not _NAME.fullmatch(name)), None)
    if wrong is not None or len(set(names)) < len(names):
        raise ValueError("expected different names with commas between, such as x1, x2")
    return names


def _assignments(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in text.split(",") if text else ():
        name, sign, value = part.partition("=")
        if not sign or not _NAME.fullmatch(name.strip()):
            raise ValueError(f"expected name = number, found {part.strip()!r}")
        found[name.strip()] = _number(value)
    return found


def _expression(text: str, known: set[str]) -> str:
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
