r"""The innovation of every output as it is printed, and what the time \tau in it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hgorun.export.equations import Output
from hgorun.export.printed_names import PrintedNames
from hgorun.export.typeset import Formula, bracketed, called_max, difference, number, wrapped


@dataclass(frozen=True, eq=False, repr=False)
class PrintedInnovation:
    r"""Writes e = C xhat(\tau) - y(\tau) + alpha(t) - alpha(\tau), output by output.

    Attributes
    ----------
    names : PrintedNames
    outputs : sequence of Output
    guesses, lags : sequence of Formula
        C xhat of all outputs; the delays of those that are continuous and late.
    single : set of str
        What may be called at a time without brackets.
    """

    names: PrintedNames
    outputs: Sequence[Output]
    guesses: Sequence[Formula]
    lags: Sequence[Formula]
    single: set[str]

    def told(self) -> str:
        r"""What \tau is of samples, behind the words "with the innovation"."""
        sampled = [output for output in self.outputs if output.sampled]
        if not sampled:
            return ""
        (e, tau), of_output = (self.names.errors[0], self.names.times[0]), ""
        if len(self.outputs) > 1:  # each has a newest sample of its own
            e, tau, of_output = e.replace("_{1}", "_i"), tau.replace("_{1}", "_i"), " of output $i$"
        newest, start = f"the newest sample{of_output}", ""
        if any(output.late for output in sampled):
            newest, start = f"{newest} that has arrived", ", or 0 if that was before the start"
        return f", ${tau}$ being the time when {newest} was taken{start} (before the first one ${e} = 0$),"

    def equations(self) -> Iterator[tuple[str, Formula]]:
        r"""The innovations, then every \tau that is a function of time."""
        for i, output in enumerate(self.outputs):
            terms, e, w = self._terms(i), self.names.errors[i], self.names.differences[i]
            if output.period is None:
                yield e, Formula(terms, 0)
            else:
                yield w, Formula(terms, 0)
                yield e, wrapped(w, number(output.period))
        for i, output in enumerate(self.outputs):
            if not output.sampled and output.delay is not None:
                yield self.names.times[i], self._late(i)

    def phases(self) -> Iterator[str]:
        r"""What \tau is of outputs that are sampled in some phases of the run only, as sentences."""
        for i, output in enumerate(self.outputs):
            if output.sampled and output.continuous:
                which = f"output {i + 1}" if len(self.outputs) > 1 else "the output"
                tau = "t" if output.delay is None else self._late(i).text
                yield f"Where {which} is continuous, ${self.names.times[i]} = {tau}$."

    def _terms(self, i: int) -> tuple[str, ...]:
        """What is added up to the innovation of an output, but for whole periods."""
        output, guess, y = self.outputs[i], self.guesses[i], self.names.outputs[i]
        if not output.sampled and output.delay is None:
            return (*guess.terms, f"- {y}")
        tau, alpha = self.names.times[i], self.names.alphas[i]
        guessed = _at_time(guess, tau, single=guess.text in self.single)
        return guessed, f"- {y}({tau})", f"+ {alpha}(t)", f"- {alpha}({tau})"

    def _late(self, i: int) -> Formula:
        """The time that a continuous output is of: before the start everything is as it is there."""
        late = [k for k, output in enumerate(self.outputs) if output.delay is not None]
        return called_max(number(0.0), difference(Formula(("t",)), self.lags[late.index(i)]))


def _at_time(a: Formula, time: str, *, single: bool) -> str:
    """A formula of things that change, at a time; ``single`` is a symbol that stands for one of them."""
    return f"{a.text}({time})" if single else rf"\left.{bracketed(a.text)}\right|_{{{time}}}"
