"""Formulas of LaTeX read as a reader does."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Protocol


class Scene(Protocol):
    """What everything is at a time."""

    def __getitem__(self, symbol: str) -> float:
        """What a symbol stands for."""

    def at(self, t: float) -> Scene:
        """The same at another time."""


Node = Callable[[Scene], float]

_FUNCTIONS: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "exp", "sinh", "cosh", "tanh")},
    **{"ln": math.log, "max": max, "min": min, "sign": lambda x: math.copysign(1.0, x) if x else 0.0},
}
_RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    r"\leq": lambda a, b: a <= b,
    r"\geq": lambda a, b: a >= b,
    "=": lambda a, b: a == b,
    r"\neq": lambda a, b: a != b,
}


class Parser:
    """A formula, by its typography alone: juxtaposed factors are multiplied, what stands in brackets goes together."""

    def __init__(self, text: str, symbols: Sequence[str]) -> None:
        self.text, self.symbols = text, sorted(symbols, key=len, reverse=True)

    def formula(self) -> Node:
        node = self.sum()
        assert not self.text.strip(), self.text
        return node

    def takes(self, *tokens: str) -> str:
        """The token that stands here, or nothing."""
        self.text = self.text.lstrip()
        for token in tokens:
            behind = self.text[len(token) :]
            if self.text.startswith(token) and not (re.fullmatch(r"\\[A-Za-z]+", token) and behind[:1].isalpha()):
                self.text = behind
                return token
        return ""

    def must(self, token: str) -> None:
        assert self.takes(token), (token, self.text)

    def sum(self) -> Node:
        first = self.product()
        while sign := self.takes("+", "-"):
            first = _two(first, self.product(), (lambda a, b: a + b) if sign == "+" else (lambda a, b: a - b))
        return first

    def product(self) -> Node:
        if self.takes("-"):
            of = self.product()
            return lambda scene: -of(scene)
        first = self.power()
        while self.takes(r"\,", r"\cdot"):
            first = _two(first, self.power(), lambda a, b: a * b)
        return first

    def power(self) -> Node:
        base = self.atom()
        if self.takes("^{"):
            exponent = self.sum()
            self.must("}")
            return _two(base, exponent, lambda a, b: a**b)
        return base

    def atom(self) -> Node:
        if number := re.match(r"\s*(\d+(?:\.\d+)?)", self.text):
            self.text = self.text[number.end() :]
            return lambda scene, value=float(number[1]): value  # type: ignore[misc]  # a default holds the value
        for symbol in self.symbols:
            if self.takes(symbol):
                return self.of_time(symbol)
        if self.takes(r"\pi"):
            return lambda scene: math.pi
        if self.takes(r"\frac{"):
            above = self.sum()
            self.must("}")
            self.must("{")
            below = self.sum()
            self.must("}")
            return _two(above, below, lambda a, b: a / b)
        if self.takes(r"\sqrt{"):
            of = self.sum()
            self.must("}")
            return lambda scene: math.sqrt(of(scene))
        if self.takes(r"\mathbf{1}\!\left("):
            holds = self.condition()
            self.must(r"\right)")
            return lambda scene: float(holds(scene))
        for opening, closing, function in (
            (r"\left(", r"\right)", lambda x: x),
            (r"\left|", r"\right|", abs),
            (r"\left\lfloor", r"\right\rfloor", math.floor),
        ):
            if self.takes(opening):
                inner = self.sum()
                self.must(closing)
                return lambda scene, f=function, of=inner: f(of(scene))  # type: ignore[misc]  # as above
        if self.takes(r"\left."):
            inner = self.sum()
            self.must(r"\right|_{")
            return self.then(inner, "}")
        name = re.match(r"\\(?:operatorname\{(\w+)\}|(\w+))\\left\(", self.text)
        assert name, self.text
        self.text = self.text[name.end() :]
        arguments = [self.sum()]
        while self.takes(","):
            arguments.append(self.sum())
        self.must(r"\right)")
        called = _FUNCTIONS[name[1] or name[2]]
        return lambda scene: called(*[argument(scene) for argument in arguments])

    def condition(self) -> Node:
        """Where something holds: 1, else 0."""
        first = self.relation()
        while sign := self.takes(r"\wedge", r"\vee"):
            first = _two(first, self.relation(), min if sign == r"\wedge" else max)
        return first

    def relation(self) -> Node:
        if self.takes(r"\neg"):
            of = self.relation()
            return lambda scene: 1.0 - of(scene)
        before = self.text
        if self.takes(r"\left("):
            inner = self.condition()
            if self.takes(r"\right)") and not self.takes(*_RELATIONS):
                return inner
            self.text = before  # it was a bracket of numbers
        left, sign = self.sum(), self.takes(*_RELATIONS)
        if not sign:
            return left
        return _two(left, self.sum(), lambda a, b: float(_RELATIONS[sign](a, b)))

    def of_time(self, symbol: str) -> Node:
        """A symbol now, or at the time that stands in brackets behind it."""
        here: Node = lambda scene: scene[symbol]  # noqa: E731  # it is passed on
        return self.then(here, ")") if self.takes("(") else here

    def then(self, node: Node, closing: str) -> Node:
        """A formula at the time that comes next, a symbol."""
        time = next(symbol for symbol in self.symbols if self.takes(symbol))
        self.must(closing)
        return lambda scene: node(scene.at(scene[time]))


def _two(a: Node, b: Node, function: Callable[[float, float], float]) -> Node:
    return lambda scene: function(a(scene), b(scene))
