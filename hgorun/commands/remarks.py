"""What is said on stderr of a result: remarks, what is not ok, and numbers that are not as exact as they look."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping

from hgorun.engine.methods import METHODS
from hgorun.errors import printable
from hgorun.result.records.data import PLANT, Integration
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

_COARSE, _FINE = 1e-2, 1e-3  # errors of given steps that are told, and that would do


def warn(result: Result, experiment: Experiment | None = None) -> None:
    """Remarks and whatever is not ok are reported on stderr; they are not errors.

    Parameters
    ----------
    result : Result
    experiment : Experiment, optional
        What was simulated, where that is known: a step that was given may be what an observer diverges with.
    """
    words = [*result.remarks, *result.troubles(), *_with_a_given_step(result, experiment), *coarse(result)]
    for one in words:
        print(f"hgorun: {of_run(result.name, one)}", file=sys.stderr)


def of_run(name: str, words: str) -> str:
    """What is told of a run, behind its name unless it begins with the file that is called so."""
    return words if re.match(rf"{re.escape(name)}\.ya?ml:", words) else f"{name}: {words}"


def coarse(result: Result) -> Iterator[str]:
    """What is said of numbers that a given step or given tolerances make wrong."""
    how, errors = result.integration, result.integration_error or {}
    if how is None or how.method is None:
        return
    told = {PLANT: result.verdict} | {label: o.verdict for label, o in result.observers.items()}
    for label, error in errors.items():
        if error > _COARSE and told[label].status == "ok":
            yield f"{_how_large(label, error)}; {_better(how, error)}, or leave it out"


def coarse_members(largest: Mapping[str, float]) -> Iterator[str]:
    """The same of an ensemble, by the largest errors that are known among members that are ok."""
    for label, error in largest.items():
        if error > _COARSE:
            better = "give a shorter step or smaller tolerances, or leave them out"
            yield f"{_how_large(printable(label), error)} in the worst member checked; {better}"


def _how_large(label: str, error: float) -> str:
    who = label if label == PLANT else f"observer {label}"
    size = f"about {error:.1g}" if error < 1 else "as large as the numbers"
    return f"{who}: the integration error is {size}"


def _better(how: Integration, error: float) -> str:
    """What would make the error a thousandth, as far as can be told: of steps, shorter ones than were made."""
    if how.step is None:
        return f"give smaller tolerances than rtol {how.rtol:g}"
    shorter = min(max((error / _FINE) ** (1 / METHODS[how.method or "rk4"].order), 2.0), 100.0)
    made = min(how.step, how.longest_gap or how.step)
    return f"give a step of {_rounded_down(made / shorter):.1g}"


def _rounded_down(value: float) -> float:
    """To one digit."""
    unit: float = 10.0 ** math.floor(math.log10(value * (1 + 1e-9)))
    return unit * math.floor(value / unit * (1 + 1e-9))


def _with_a_given_step(result: Result, experiment: Experiment | None) -> Iterator[str]:
    """Who may have diverged with the step alone, which has been given."""
    how = result.integration
    if experiment is None or experiment.blocks.solver.controlled or how is None or how.step is None:
        return
    lost = [label for label, o in result.observers.items() if o.verdict.status == "diverged"]
    if lost:
        yield f"{', '.join(lost)}: a step of {how.step:g} was given; a shorter one, or none, tells whether that is why"
