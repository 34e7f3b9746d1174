"""Printed equations read as a reader does, and integrated by themselves: the oracle of what LaTeX says."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from naive import hermite
from printed_formulas import Node, Parser

from hgorun.export.accents import barred, dotted

Vector = npt.NDArray[np.float64]
Time = Callable[[float, float], float]


def equations(text: str) -> Iterator[tuple[str, str]]:
    """Left and right sides, lines of one equation together."""
    for block in re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL):
        for line in re.sub(r"\\\\\s*&\\quad", " ", block).split(r"\\"):
            left, right = line.split("&=")
            yield left.strip(), right.strip()


@dataclass
class Printed:
    """An observer that follows its printed equations.

    Attributes
    ----------
    text : str
        The document.
    known : mapping of str to callable
        Inputs and outputs as functions of time, by their symbols.
    times : mapping of str to callable
        What is told of in words, by its symbol: the time that an innovation is of, now and in a step that has begun
        earlier. It raises :class:`Unheard` before the first sample.
    arrivals : sequence of sequence of float
        When samples of each output arrive, where the observer jumps at them.
    """

    text: str
    known: Mapping[str, Callable[[float], float]]
    times: Mapping[str, Time] = field(default_factory=dict)
    arrivals: Sequence[Sequence[float]] = ()

    def __post_init__(self) -> None:
        pairs = list(equations(self.text))
        assert len({left for left, _ in pairs}) == len(pairs), "no thing is said twice"
        begins = {left.removesuffix("(0)"): Parser(right, ()).formula() for left, right in pairs if "(0)" in left}
        self.states = list(begins)
        self.start = np.array([begin(Moment(self, 0.0, np.zeros(0))) for begin in begins.values()])
        defined = {left: right for left, right in pairs if not left.endswith("(0)")}
        others = {left for left in defined if not left.startswith(r"\dot")}
        self.flags = {rf"\varphi_{{{i + 1}}}": times for i, times in enumerate(self.arrivals)}
        of_samples = ["t_{k-1}", "t_{k}", "T_{k}", *self.flags] if self.arrivals else []
        symbols = ["t", *of_samples, *self.states, *self.known, *self.times, *others]
        assert len(set(symbols)) == len(symbols), "no two things are called the same"
        self.formulas = {left: Parser(right, symbols).formula() for left, right in defined.items()}
        still: Node = lambda scene: 0.0  # noqa: E731  # it is passed on
        self.rates = [self.formulas.get(dotted(state), still) for state in self.states]
        self.jumps = {i: self.formulas.get(f"{state}^{{+}}") for i, state in enumerate(self.states)}

    def integrate(self, end: float, step: float) -> None:
        """Find the states at all multiples of a step."""
        self.step, self.z, self.dz = step, [self.start], list[Vector]()
        for k in range(round(end / step)):
            t, z = k * step, self.z[-1]
            self.begun = t
            self.z[-1] = z = self.jumped(t, z)
            k1 = self.slope(t, z)
            self.dz.append(k1)
            k2 = self.slope(t + step / 2, z + step / 2 * k1)
            k3 = self.slope(t + step / 2, z + step / 2 * k2)
            k4 = self.slope(t + step, z + step * k3)
            self.z.append(z + step * (k1 + 2 * k2 + 2 * k3 + k4) / 6)

    def estimates(self, states: Sequence[str]) -> Vector:
        """The estimates of states of the plant, by their symbols, at all times that were integrated."""
        found = []
        for state in states:
            name = next((name for name in (barred(state), state) if name in self.formulas), None)
            of: Node = self.formulas[name] if name else lambda scene, name=state: scene[name]  # type: ignore[misc]  # it holds the name
            found.append([of(Moment(self, k * self.step, z)) for k, z in enumerate(self.z)])
        return np.array(found)

    def jumped(self, t: float, z: Vector) -> Vector:
        """The states after the samples of a time."""
        before = [time for times in self.arrivals for time in times if time < t - 1e-9]
        if not any(abs(time - t) < 1e-9 for times in self.arrivals for time in times):
            return z
        if "from the second ones on" in self.text and not before:
            return z
        scene = Moment(self, t, z, {"t_{k}": t, "t_{k-1}": max(before, default=t)})
        return np.array([z[i] if jump is None else jump(scene) for i, jump in self.jumps.items()])

    def slope(self, t: float, z: Vector) -> Vector:
        scene = Moment(self, t, z)
        return np.array([rate(scene) for rate in self.rates])

    def past(self, t: float) -> Vector:
        """The states at an earlier time."""
        k = round(t / self.step)
        if abs(t - k * self.step) < 1e-9:
            return self.z[k]
        k = min(int(t / self.step), len(self.dz) - 2)
        ends = k * self.step, (k + 1) * self.step
        return hermite(t, *ends, self.z[k], self.z[k + 1], self.dz[k], self.dz[k + 1])


@dataclass
class Moment:
    """What everything is at a time."""

    printed: Printed
    t: float
    z: Vector
    samples: Mapping[str, float] = field(default_factory=dict)
    found: dict[str, float] = field(default_factory=dict)

    def __getitem__(self, symbol: str) -> float:
        printed = self.printed
        if symbol == "t":
            return self.t
        if symbol in self.samples:
            return self.samples[symbol]
        if symbol == "T_{k}":
            return self.samples["t_{k}"] - self.samples["t_{k-1}"]
        if symbol in printed.flags:
            return float(any(abs(time - self.t) < 1e-9 for time in printed.flags[symbol]))
        if symbol in printed.states:
            return float(self.z[printed.states.index(symbol)])
        if symbol in printed.known:
            return printed.known[symbol](self.t)
        if symbol in printed.times:
            return printed.times[symbol](self.t, printed.begun)
        if symbol not in self.found:
            try:
                self.found[symbol] = printed.formulas[symbol](self)
            except Unheard:  # before the first sample
                self.found[symbol] = 0.0
        return self.found[symbol]

    def at(self, t: float) -> Moment:
        return self if t == self.t else Moment(self.printed, t, self.printed.past(t))


def newest(arrived: Sequence[float], taken: Sequence[float]) -> Time:
    """When the newest sample was taken of those that have arrived: what arrives at the end of a step is not there."""

    def time(now: float, begun: float) -> float:
        index = bisect_right(arrived, begun + 1e-9) - 1
        if index < 0:
            raise Unheard
        return max(0.0, taken[index])

    return time


class Unheard(Exception):
    """There is no sample yet."""
