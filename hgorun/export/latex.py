"""An observer as equations of LaTeX, with its numbers in them, for a paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.export.accents import barred, dotted
from hgorun.export.equations import Symbolic, symbolic
from hgorun.export.names import shown
from hgorun.export.observer import Exported
from hgorun.export.printed_innovation import PrintedInnovation
from hgorun.export.printed_names import PrintedNames
from hgorun.export.typeset import INDICATOR, Formula, Written, broken, number, written
from hgorun.tables.typeset import latex_words
from hgorun.version import __version__


def latex(observer: Exported) -> str:
    r"""The equations of an observer, to be read by ``\input`` into a document that loads amsmath.

    The inputs of the plant are symbols; numbers have six digits. Long expressions that are needed several times
    are abbreviated.
    """
    return Document(observer).text()


@dataclass(frozen=True, eq=False, repr=False)
class Document:
    """Writes the equations of an observer.

    Attributes
    ----------
    observer : Exported
    """

    observer: Exported

    @cached_property
    def equations(self) -> Symbolic:
        """Of the observer, whose inputs are symbols."""
        o = self.observer
        return symbolic(o.design, o.plant, o.outputs, o.origin, told=tuple(range(len(o.plant.model.inputs))))

    @cached_property
    def names(self) -> PrintedNames:
        return PrintedNames(self.observer)

    @property
    def states(self) -> list[str]:
        """What the entries of z are called."""
        return self.names.states

    @property
    def _names(self) -> dict[tuple[int, int], str]:
        """What the entries of t, p, z and w are called."""
        inputs = self.names.inputs
        after = [*inputs, *["?"] * len(inputs), *self.names.errors]
        return {(0, 0): "t"} | _numbered(2, self.states) | _numbered(3, after)

    def text(self) -> str:
        return "\n".join(self._lines()) + "\n"

    def _lines(self) -> Iterator[str]:
        observer = self.observer
        kind = observer.design.observer.type
        yield f"% Observer {shown(observer.label)} ({kind}) of {shown(observer.run)}, by hgorun {__version__}."
        yield "% Needs the package amsmath."
        yield ""
        equations = list(self._of_time())
        yield from equations
        if any(INDICATOR in line for line in equations):
            yield f"Here ${INDICATOR}(A)$ is 1 where $A$ holds, and 0 elsewhere."
        yield from self._start()

    def _of_time(self) -> Iterator[str]:
        """What goes on between samples and at them."""
        abbreviated = 0
        if self.observer.flows:
            flow = self._of_flow()
            abbreviated = len(flow.abbreviations)
            yield from self._flow(flow)
        if self.equations.jump is not None:
            yield from self._jump(first=abbreviated + 1)  # each abbreviation is one thing in the whole document

    def _of_flow(self) -> Written:
        compared = ["guess", "delay"] if self.observer.compares else []
        outputs = {name: of for name, of in self.equations.outputs.items() if name in ("rate", "estimate", *compared)}
        return self._written("flow", self.equations.arguments, outputs, self._names)

    def _flow(self, found: Written) -> Iterator[str]:
        label = latex_words(self.observer.label)
        yield f"The observer {label} is" if self.equations.jump is None else f"Between samples, the observer {label} is"
        yield from _aligned(zip(map(dotted, self.states), found.formulas["rate"], strict=True))
        if self.observer.compares:
            innovation = self._innovation(found)
            yield f"with the innovation{innovation.told()}"
            yield from _aligned(innovation.equations())
            yield from innovation.phases()
        yield from self._rest(found)

    def _innovation(self, found: Written) -> PrintedInnovation:
        names, lags = self.names, found.formulas.get("delay", [])
        single = {*self.states, *names.inputs, *(name for name, _ in found.abbreviations)}
        return PrintedInnovation(names, self.observer.outputs, found.formulas["guess"], lags, single)

    def _rest(self, found: Written) -> Iterator[str]:
        """Abbreviations, and the estimate where it is not among the states."""
        if found.abbreviations:
            yield "where"
            yield from _aligned(found.abbreviations)
        formulas, names = found.formulas["estimate"], self.names.estimates
        if [formula.text for formula in formulas] != names:
            if not set(names).isdisjoint(self.states):  # clipped states are not the states
                names = [barred(name) for name in names]
            yield "The estimate is"
            yield from _aligned(zip(names, formulas, strict=True))

    def _jump(self, first: int) -> Iterator[str]:
        jump, held = self.equations.jump, self.equations.held
        assert jump is not None
        names = {(0, 0): "t_{k}"} | _numbered(2, self.states)
        interval = self.names.interval
        for i, y in enumerate(self.names.outputs):
            names[3, held.output(i)] = f"{y}(t_{{k}})"
            names[3, held.previous(i)] = f"{y}(t_{{k-1}})"
            if held.flags:
                names[3, held.fresh(i)] = rf"\varphi_{{{i + 1}}}"
        for i, u in enumerate(self.names.inputs):
            value, _, _, before = held.input(i)
            names[3, value], names[3, before] = f"{u}(t_{{k}})", f"{u}(t_{{k-1}})"
        names[3, held.interval] = interval
        found = self._written("jump", self.equations.jump_arguments, {"jump": jump}, names, first)
        told = r" ($\varphi_i = 1$ for the outputs that have one, else 0)" if held.flags else ""
        if not self.observer.corrected:  # it compares with the sample before
            told += rf" (from the second ones on), ${interval} = t_{{k}} - t_{{k-1}}$"
        yield f"When samples arrive at $t_k${told},"
        changed = [(s, f) for s, f in zip(self.states, found.formulas["jump"], strict=True) if f.text != s]
        yield from _aligned((rf"{state}^{{+}}", formula) for state, formula in changed)
        if found.abbreviations:
            yield "where"
            yield from _aligned(found.abbreviations)

    def _start(self) -> Iterator[str]:
        pairs = list(zip(self.states, self.observer.start, strict=True))
        yield "It starts at"
        yield from _aligned((f"{state}(0)", number(float(value))) for state, value in pairs)

    def _written(
        self,
        name: str,
        arguments: Sequence[ca.SX],
        outputs: Mapping[str, ca.SX],
        names: dict[tuple[int, int], str],
        first: int = 1,
    ) -> Written:
        t, p, z, w = arguments
        values = ca.SX(ca.DM(np.asarray(self.equations.values)))
        results = [ca.densify(ca.substitute(expression, p, values)) for expression in outputs.values()]
        function = ca.Function(name, [t, ca.SX(0, 1), z, w], ca.cse(results), ["t", "p", "z", "w"], list(outputs))
        return written(function, names, self.names.abbreviation, first)


def _numbered(vector: int, names: Sequence[str]) -> dict[tuple[int, int], str]:
    return {(vector, i): name for i, name in enumerate(names)}


def _aligned(pairs: Iterator[tuple[str, Formula]] | Sequence[tuple[str, Formula]]) -> Iterator[str]:
    r"""Equations below each other, in an ``align*``."""
    lines: list[str] = []
    for left, formula in pairs:
        first, *others = broken(formula)
        lines += [rf"  {left} &= {first}", *(rf"  &\quad {other}" for other in others)]
    if lines:
        yield r"\begin{align*}"
        yield from (rf"{line} \\" for line in lines[:-1])
        yield lines[-1]
        yield r"\end{align*}"
