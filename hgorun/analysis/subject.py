"""What an analysis looks at: one observer of a run, beside what the simulation has shown of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from typing import TYPE_CHECKING, TypeVar, cast

from hgorun.analysis.reasons import Outcome, outcome
from hgorun.observers.base import AnyObserver
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.forms import Form

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")
Known = dict[object, Outcome[object]]


@dataclass(frozen=True)
class Context:
    """A run and its result.

    Attributes
    ----------
    run : PreparedRun
        ``run.experiment`` is what was configured.
    result : Result
        Its time counted from the start of the run, as in all that ``run`` says.
    search : bool
        Whether to look for what only repeated simulation finds.
    """

    run: PreparedRun
    result: Result
    search: bool = False
    known: Known = field(default_factory=dict, repr=False, compare=False)

    @property
    def subjects(self) -> dict[str, Subject]:
        """Every observer of the run, by label."""
        blocks = {block.label: block for block in self.run.observers}
        return {label: Subject(self, label, blocks[label]) for label in self.result.observers}


@dataclass(frozen=True)
class Subject:
    """One observer of a run.

    Attributes
    ----------
    context : Context
    label : str
    block : ObserverBlock
        Its equations, its form of the plant and its design.
    """

    context: Context
    label: str
    block: ObserverBlock
    known: Known = field(default_factory=dict, repr=False, compare=False)

    @property
    def run(self) -> PreparedRun:
        """All that was decided before the first step."""
        return self.context.run

    @property
    def result(self) -> Result:
        """The simulation: time, truth, measurements, windows."""
        return self.context.result

    @property
    def found(self) -> ObserverResult:
        """The simulated observer: its estimate, internal states, metrics."""
        return self.result.observers[self.label]

    @property
    def observer(self) -> AnyObserver:
        """The observer's block of the configuration."""
        return self.block.observer

    @property
    def form(self) -> Form:
        """The plant as the observer takes it."""
        return self.block.form

    def by_state(self, values: object) -> dict[str, float]:
        """Numbers of the plant's states, shape (n,), by their names."""
        import numpy as np

        return dict(zip(self.result.states, map(float, np.asarray(values)), strict=True))

    def rows_by_state(self, matrix: np.ndarray) -> dict[str, list[float]]:
        """The rows of a matrix, shape (n, q), by the names of the plant's states."""
        return dict(zip(self.result.states, matrix.tolist(), strict=True))


Asked = TypeVar("Asked", Context, Subject)


def once(function: Callable[[Asked], T]) -> Callable[[Asked], T]:
    """Evaluate a function once for every subject (or context): its value, or its reason, is kept."""

    @wraps(function)
    def remembered(asked: Asked) -> T:
        if function not in asked.known:
            asked.known[function] = outcome(lambda: function(asked))
        return cast(T, asked.known[function].value)

    return remembered
