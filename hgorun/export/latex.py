"""An observer as equations of LaTeX, with its numbers in them, for a paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.export.equations import Symbolic, symbolic
from hgorun.export.names import shown
from hgorun.export.observer import Exported
from hgorun.export.typeset import INDICATOR, Formula, Written, broken, dotted, number, written
from hgorun.symbolic.states import StateBlock
from hgorun.tables.typeset import latex_words, symbol
from hgorun.version import __version__

_LETTERS = "abcdghklmqrvw"


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
    def states(self) -> list[str]:
        """What the entries of z are called."""
        found: list[str] = []
        canonical = self.equations.block.canonical
        for name, block in self.equations.block.states.items():
            if name == "xhat":
                names = [f"z{i + 1}" for i in range(block.size)] if canonical else list(self.observer.states)
                found += [symbol(one, hat=True) for one in names]
            else:
                found += _entries(symbol(name), block)
        return found

    @cached_property
    def outputs(self) -> list[str]:
        return [symbol(output.name) for output in self.observer.outputs]

    @property
    def _names(self) -> dict[tuple[int, int], str]:
        """What the entries of t, p, z and w are called."""
        inputs = [symbol(name) for name in self.observer.plant.model.inputs]
        errors = _indexed("e", len(self.outputs))
        after = [*inputs, *["?"] * len(inputs), *errors]
        return {(0, 0): "t"} | _numbered(2, self.states) | _numbered(3, after)

    @property
    def _letter(self) -> str:
        """One that nothing else is called by."""
        taken = "".join([*self.states, *self.outputs, *self.observer.plant.model.inputs, *self.observer.states])
        return next((letter for letter in _LETTERS if letter not in taken), r"\Lambda")

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
        names, outputs = ["rate", "estimate", "guess"], self.equations.outputs
        return self._written("flow", self.equations.arguments, {name: outputs[name] for name in names}, self._names)

    def _flow(self, found: Written) -> Iterator[str]:
        label = latex_words(self.observer.label)
        yield f"The observer {label} is" if self.equations.jump is None else f"Between samples, the observer {label} is"
        yield from _aligned(zip(map(dotted, self.states), found.formulas["rate"], strict=True))
        if self.observer.compares:
            sampled = any(output.sampled for output in self.observer.outputs)
            told = r", $\tau$ being the time when the newest sample was taken," if sampled else ""
            yield f"with the innovation{told}"
            yield from _aligned(self._innovations(found.formulas["guess"]))
        yield from self._rest(found)

    def _rest(self, found: Written) -> Iterator[str]:
        """Abbreviations, and the estimate where it is not among the states."""
        estimates = [symbol(name, hat=True) for name in self.observer.states]
        texts = [formula.text for formula in found.formulas["estimate"]]
        if found.abbreviations:
            yield "where"
            yield from _aligned(found.abbreviations)
        if texts != estimates:
            yield "The estimate is"
            yield from _aligned(zip(estimates, found.formulas["estimate"], strict=True))

    def _innovations(self, guesses: Sequence[Formula]) -> Iterator[tuple[str, Formula]]:
        r"""C xhat - y at the time \tau that the measurement is of, and what alpha has become since then."""
        errors = _indexed("e", len(self.outputs))
        alphas = _entries(symbol("alpha"), self.equations.block.states["alpha"]) if self._has_alpha else []
        for i, (e, guess, y) in enumerate(zip(errors, guesses, self.outputs, strict=True)):
            output = self.observer.outputs[i]
            if not output.sampled and output.delay is None:
                yield e, Formula((*guess.terms, f"- {y}"), 0)
                continue
            tau = rf"t - {output.delay}" if output.delay is not None and _plain(output.delay) else r"\tau"
            at = (
                rf"\left.\left({guess.text}\right)\right|_{{{tau}}}"
                if len(guess.terms) > 1
                else rf"{guess.text}({tau})"
            )
            yield e, Formula((at, f"- {y}({tau})", f"+ {alphas[i]}(t)", f"- {alphas[i]}({tau})"), 0)

    @property
    def _has_alpha(self) -> bool:
        return "alpha" in self.equations.block.states

    def _jump(self, first: int) -> Iterator[str]:
        jump, held = self.equations.jump, self.equations.held
        assert jump is not None
        names = {(0, 0): "t_{k}"} | _numbered(2, self.states)
        inputs = [symbol(name) for name in self.observer.plant.model.inputs]
        for i, y in enumerate(self.outputs):
            names[3, held.output(i)] = f"{y}(t_{{k}})"
            names[3, held.previous(i)] = f"{y}(t_{{k-1}})"
            if held.flags:
                names[3, held.fresh(i)] = rf"\varphi_{{{i + 1}}}"
        for i, u in enumerate(inputs):
            value, _, _, before = held.input(i)
            names[3, value], names[3, before] = f"{u}(t_{{k}})", f"{u}(t_{{k-1}})"
        names[3, held.interval] = r"T_{k}"
        found = self._written("jump", self.equations.jump_arguments, {"jump": jump}, names, first)
        told = r" ($\varphi_i = 1$ for the outputs that have one, else 0)" if held.flags else ""
        told += "" if self.observer.flows else r", $T_k = t_k - t_{k-1}$"
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
        return written(function, names, self._letter, first)


def _plain(delay: str) -> bool:
    """Whether a delay is a number."""
    return delay.replace(".", "", 1).isdigit()


def _indexed(letter: str, count: int) -> list[str]:
    return [rf"{letter}_{{{i + 1}}}" for i in range(count)] if count > 1 else [letter]


def _numbered(vector: int, names: Sequence[str]) -> dict[tuple[int, int], str]:
    return {(vector, i): name for i, name in enumerate(names)}


def _entries(name: str, block: StateBlock) -> list[str]:
    """The entries of an internal state."""
    if block.size == 1 and not block.symmetric:
        return [name]
    base = name if "_" not in name else f"{{{name}}}"
    shape = block.shape[:-1] if len(block.shape) > 1 and block.shape[-1] == 1 else block.shape
    triangle = zip(*np.triu_indices(block.shape[0]), strict=True) if block.symmetric else ()
    pairs = list(triangle) or list(np.ndindex(*shape))
    return [rf"{base}_{{{','.join(str(int(k) + 1) for k in index)}}}" for index in pairs]


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
