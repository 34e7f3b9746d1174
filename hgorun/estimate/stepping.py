"""Observers of a stream that step from sample to sample: of all outputs, with the inputs of the sample before."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.engine.plan import Floats
from hgorun.estimate.event import Event
from hgorun.estimate.live_system import LiveSystem


def require_whole(system: LiveSystem, event: Event, newest: Sequence[Sequence[float]]) -> None:
    """Refuse the next sample where one of another output is missing.

    Parameters
    ----------
    newest : sequence of sequence of float
        Of every output when the newest sample was taken that each observer has used.

    Raises
    ------
    ValueError
    """
    last = [taken[0] for taken in newest]
    if event.t > max(last) > min(last):
        missing = ", ".join(name for name, i in system.outputs.items() if last[i] < max(last))
        raise ValueError(
            f"{system.stepping} steps from sample to sample of all outputs, and that of {missing} at "
            f"t = {system.experiment.origin + max(last):g} is missing: give those of one time together, or one after "
            "the other"
        )


def keep_inputs(system: LiveSystem, w: Floats) -> None:
    """Those at a sample are the inputs before to the step that follows."""
    for place, _, _, before in map(system.structure.system.held.input, range(len(system.inputs))):
        w[before] = w[place]
