"""Observers that are not exported, and what to do instead."""

from __future__ import annotations

from hgorun.errors import Problem
from hgorun.export.equations import compares
from hgorun.observers.aekf import AdaptiveFilter
from hgorun.observers.base import AnyObserver, CorrectedObserver, DecidedObserver, SampledObserver
from hgorun.observers.capabilities import NotExported, Punctual
from hgorun.observers.recalling import RecallingObserver
from hgorun.observers.stepped import SteppedObserver
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.prepared import PreparedRun


def require_exportable(run: PreparedRun, label: str, late: float) -> None:
    """Refuse an observer of which exported code cannot do what it does in a run, or what is asked of it.

    Parameters
    ----------
    run : PreparedRun
    label : str
    late : float
        How late its samples may be, beside what the run has.

    Raises
    ------
    Problem
    """
    observer, path = run.experiment.designs[label].observer, ("observers", label)
    if isinstance(observer, NotExported):
        raise Problem((*path, "type"), observer.not_exported)
    steps_alone = isinstance(observer, SteppedObserver) and run.experiment.sampled()
    if isinstance(observer, DecidedObserver) and not steps_alone:
        raise Problem(
            (*path, "type"),
            f"{observer.type} decides at the ends of the solver's steps, and exported code only follows the "
            f"flow and takes samples in: there is no place in it for decisions; {_without_decisions(observer)}",
        )
    if isinstance(observer, RecallingObserver):
        raise Problem((*path, "type"), "it looks back at its own past, which is kept in simulations alone")
    if treatment_of(observer) in run.treatments:
        raise Problem(
            (*path, "late"),
            "exported code takes late samples into the innovation or not at all: it does not go back to the time of a "
            f"sample, and leaves none out; {_without_lateness(run, label)}",
        )
    if late and not (compares(observer) and not isinstance(observer, SampledObserver)):
        raise Problem(
            (*path, "type"),
            f"exported code of {observer.type} takes samples when they are taken: they jump to now, and it does "
            "not go back to late ones; leave --late out, or choose others with --observer",
        )


def _without_decisions(observer: AnyObserver) -> str:
    """What is exported in place of an observer that decides."""
    if isinstance(observer, AdaptiveFilter):
        return "with update: jump, for sampled outputs, it has none and is exported"
    if isinstance(observer, SteppedObserver):
        return "with sampled outputs it steps from each to the next and is exported"
    return "take the observer of one mode, such as shgo, or updated, whose gain follows errors without them"


def _without_lateness(run: PreparedRun, label: str) -> str:
    """What to change for an observer that goes back to late samples, or leaves them out."""
    data = run.experiment.blocks.data
    recorded = {} if data is None else data.outputs
    keys = [f"data.outputs.{name}.available" for name, one in recorded.items() if one.available is not None]
    said = f"take {' and '.join(keys)} out" if keys else "leave measurement.delay out"
    without = isinstance(run.experiment.observers[label], CorrectedObserver | SampledObserver | Punctual)
    return said if without else f"say `late: innovation`, or {said}"
