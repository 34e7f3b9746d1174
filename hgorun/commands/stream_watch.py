"""What is told on stderr while a stream runs, each once: inputs that do not come, and gates that lock out."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.estimate.scores.shut_out import too_many, until_too_many
from hgorun.estimate.stream.estimator import Estimator
from hgorun.process import say


class Watch:
    """Looks at what comes.

    Parameters
    ----------
    estimator : Estimator
    inputs : sequence of str
        Those that come with the samples, and have not yet; none where the stream goes on from a checkpoint.
    """

    def __init__(self, estimator: Estimator, inputs: Sequence[str]) -> None:
        self._estimator, self._inputs = estimator, list(inputs)
        self._since: float | None = None
        self._told = set[tuple[str, str]]()
        self._gated = bool(next(iter(estimator.gated.values()), {}))
        self._before = estimator.gated_in_a_row  # of a stream that goes on
        self._until = 1  # samples before it is worth to look at gates again

    def took(self, signal: str, t: float) -> None:
        """A sample, which has been used or left out."""
        if self._inputs:
            self._look_for_inputs(signal, t)
        self._until -= 1
        if self._gated and self._until <= 0:
            self._look_at_gates(t)

    def _look_for_inputs(self, signal: str, t: float) -> None:
        if signal in self._inputs:
            self._inputs.remove(signal)
        elif self._since is None:
            self._since = t  # those of the start may come behind the first sample
        elif t > self._since and self._inputs:
            names = ", ".join(self._inputs)
            say(f"hgorun: {names}: no value has come by t = {t:.10g}: until one comes the input counts as 0")
            self._inputs.clear()

    def _look_at_gates(self, t: float) -> None:
        longest = 0
        for label, of_outputs in self._estimator.gated_in_a_row.items():
            for output, count in of_outputs.items():
                longest = max(longest, 0 if (label, output) in self._told else count)
                is_new = count > self._before[label][output] and (label, output) not in self._told
                if is_new and too_many(0, 0, count):
                    self._told.add((label, output))
                    say(
                        f"hgorun: {label}: by t = {t:.10g} the gate of {output} has left out {count} samples one after "
                        "the other: the estimate does not follow what is measured"
                    )
        self._until = until_too_many(longest)
