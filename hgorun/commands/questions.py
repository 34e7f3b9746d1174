"""A first configuration from answers at a terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from hgorun.commands import answers
from hgorun.commands.first import First, first_of, number_text, with_observers
from hgorun.commands.outputs import refuse_no_configuration
from hgorun.config.expressions import CONSTANTS, nearest, parse
from hgorun.config.time_units import run_unit
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import why_unwritable
from hgorun.plants.base import PLANTS, Input, Start

Answer = TypeVar("Answer")
Named = TypeVar("Named", bound=Collection[str])
_OWN = "own"


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
    end = _answer(f"end of the run{unit}", f"{start.end:g}", answers.positive)
    period = _answer(
        "sampling period, 0 for an output that is known at all times", f"{start.period:g}", answers.not_negative
    )
    noise = _answer("standard deviation of the noise", f"{start.noise:g}", answers.not_negative)
    types = [str(keys["type"]) for keys in start.observers.values()]
    start = replace(start, end=end, period=period or start.period, noise=noise)
    start = _answer("observers", ", ".join(types), lambda text: _observers(start, text))
    return replace(chosen, start=start, sampled=period > 0)


def ask_for_others(chosen: First, trouble: str) -> First | None:
    """The same with other observers, since those that it has do not run; nothing where they are to stay.

    Parameters
    ----------
    chosen : First
    trouble : str
        What keeps them from running.
    """
    print(f"  {trouble}", file=sys.stderr)
    question = "other observers (Enter: write it as it is)"
    start = _answer(question, "", lambda text: _observers(chosen.start, text) if text else None)
    return None if start is None else replace(chosen, start=start)


def ask_for_file(taken: Path) -> Path:
    """Another file, where there is one already of the name that a configuration would have."""
    return _answer(f"{taken} exists already: a file to write", f"my_{taken.name}", _new_file)


@dataclass
class _Model:
    """The names of your own plant, as they are told one after another."""

    states: list[str]
    parameters: dict[str, float] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    dynamics: dict[str, str] = field(default_factory=dict)
    outputs: list[str] = field(default_factory=list)

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

    def expressions(self, question: str, default: str, read: Callable[[str], Sequence[str]]) -> Sequence[str]:
        """Expressions; of a name that is not known it is asked what that is, and where it is nothing, all again."""
        while True:
            texts = _answer(question, default, read)
            if all(map(self._is_told, sorted(answers.names_in(texts) - self.known))):
                return texts

    def measured(self) -> list[str]:
        """The outputs; they are asked for again where states do not get into them, and may stay as they are."""
        outputs = self.expressions("outputs, with commas between", self.states[0], answers.outputs)
        while unseen := ", ".join(self._unseen(outputs)):
            print(
                f"  nothing that is measured depends on {unseen}, now or later: few observers take that",
                file=sys.stderr,
            )
            given, outputs = (
                outputs,
                self.expressions("outputs (Enter keeps them)", ", ".join(outputs), answers.outputs),
            )
            if outputs == given:
                break
        return list(outputs)

    def _unseen(self, outputs: Sequence[str]) -> list[str]:
        """States that neither an output nor the rate of a state that an output depends on contains."""
        seen, new = set[str](), answers.names_in(outputs)
        while new := new - seen:
            seen |= new
            new = answers.names_in(self.dynamics[name] for name in new & self.dynamics.keys())
        return [state for state in self.states if state not in seen]

    def _is_told(self, name: str) -> bool:
        """Whether an unknown name is a parameter or an input, which it is from then on."""
        print(f"  {name} is not known.{nearest(name, [*self.known, *CONSTANTS])}")
        question = "  Its number, or as an input an expression of t (Enter: write it again)"
        given = _answer(question, "", lambda text: answers.expression(text, {*self.parameters, "t"}) if text else "")
        if given and parse(given).names:
            self.inputs[name] = given
        elif given:
            self.parameters[name] = parse(given).number()
        return bool(given)

    def used(self) -> dict[str, float]:
        """The parameters that something uses; it is said which are left out."""
        used = answers.names_in((*self.dynamics.values(), *self.outputs, *self.inputs.values()))
        for name in [name for name in self.parameters if name not in used]:
            print(f"  nothing uses the parameter {name}: it is left out", file=sys.stderr)
        return {name: value for name, value in self.parameters.items() if name in used}


def _own() -> First:
    """Your own plant: states, equations, output, parameters, inputs, initial state."""
    unit = _answer("unit of time", "s", lambda text: run_unit(text.strip()))
    model = _Model([])
    model.states = states = _answer(
        "states, with commas between", "x1, x2", lambda text: model.free(text, answers.names)
    )
    none = "with those that your equations use (Enter: none)"
    model.parameters = _answer(
        f"parameters, such as a = 1, b = 0.5, {none}", "", lambda text: model.free(text, answers.assignments)
    )
    names = _answer(
        f"inputs, with commas between, {none}", "", lambda text: model.free(text, answers.names) if text else []
    )
    model.inputs = dict.fromkeys(names, "0")
    lines = [f"  states: [{', '.join(states)}]", "  dynamics:"]
    for state in states:
        (model.dynamics[state],) = model.expressions(f"{state}' =", "", lambda text: [answers.expression(text)])
        lines.append(f'    {state}: "{model.dynamics[state]}"')
    model.outputs = model.measured()
    quoted = ", ".join(f'"{text}"' for text in model.outputs)
    lines.append(f"  output: {quoted if len(model.outputs) == 1 else f'[{quoted}]'}")
    for name in names:
        model.inputs[name] = _answer(
            f"{name} =", "sin(t)", lambda text: answers.expression(text, {*model.parameters, "t"})
        )
    if model.inputs:
        lines.append("  inputs: {" + ", ".join(f'{name}: "{text}"' for name, text in model.inputs.items()) + "}")
    if parameters := model.used():
        lines.append("  parameters: {" + ", ".join(f"{k}: {number_text(v)}" for k, v in parameters.items()) + "}")
    initial = {state: _answer(f"{state} at the start", "1", answers.number) for state in states}
    estimate = {state: _answer(f"first guess of {state}", "0", answers.number) for state in states}
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
        found[name] = _answer(question, text, lambda text: answers.expression(text, {*chosen.parameters, "t"}))
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
    try:
        return with_observers(start, types)
    except ConfigError as error:
        raise ValueError(error.message) from None  # without the option that it is of elsewhere


def _new_file(text: str) -> Path:
    file = Path(text)
    refuse_no_configuration(file, "mine", "file")
    if why := "it exists already" if os.path.exists(file) else why_unwritable(file):
        raise ValueError(f"expected the name of a new file, found {file}: {why}")
    return file
