"""From a schedule to the engine's tables, with the numbers of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Plan
from hgorun.measurement.channels import Channel, joined
from hgorun.measurement.late import HeardOtherwise
from hgorun.measurement.long import LongSchedule
from hgorun.memo import Memo, same
from hgorun.simulation.timeline.long_tables import LongTables
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.tabulated import Stretchwise, Tables, Tabulated, long_from
from hgorun.simulation.timeline.timeline import Stepping, Timeline

_KEPT = 500_000  # actions and segments of tables that are kept in memory
_TABLES: Memo[Tables] = Memo(16, lambda tables: len(tables.segments.actions) + len(tables.segments.counts) < _KEPT)


def build_plan(
    timeline: Timeline,
    system: HybridSystem,
    stepping: Stepping,
    *,
    inputs: RecordedInputs | None = None,
    samples: Sequence[np.ndarray] | None = None,
    in_parts: bool = False,
    shared: Stretchwise | None = None,
) -> Plan:
    """The engine's tables, with the numbers of a run.

    Parameters
    ----------
    timeline : Timeline
    system : HybridSystem
        What the plan is for.
    stepping : Stepping
    inputs : RecordedInputs, optional
        Where the system takes its inputs from the tables.
    samples : sequence of ndarray, shape (Nk,) each, optional
        What arrives of every output, where it is recorded: the system's own outputs are zero then.
    in_parts : bool
        A plan of many events may be given part by part, so that its tables need not fit into memory.
    shared : Stretchwise, optional
        What this run shares with the one before.
    """
    schedule, channels = timeline.schedule, timeline.channels
    if in_parts and isinstance(schedule, LongSchedule) and not system.remembers:
        return LongTables(schedule, timeline.grid, system, stepping).plan(timeline.origin)
    key = schedule, system, same(timeline.grid), stepping, None if inputs is None else same(inputs)
    tabulated = partial(Tabulated, timeline, system, stepping, inputs)
    if shared is not None:
        tabulated = partial(tabulated, before=shared.last, kept=shared.KEPT)
    following = None
    if in_parts and schedule.size > long_from() and not system.remembers and schedule.order is None:
        made = tabulated()
        alike = None if shared is None else made.alike()
        tables, following = made.in_parts() if alike is None else (alike, None)
        if shared is not None:
            shared.last = made
    else:
        tables = _TABLES.get(key, lambda: tabulated().whole())
    holds = [channel.held_changes[1] for channel in channels] + [tables.values]
    if inputs is not None:
        holds += inputs.values(channels, before=bool(system.stepped))
    if samples is None:
        measured = [channel.gain_and_bias for channel in channels]
        gain, bias = joined([gain for gain, _ in measured]), joined([bias for _, bias in measured])
    else:
        bias = joined(list(_recorded(channels, samples)))
        gain = _ones(bias.size)
    return Plan(
        spans=tables.segments.spans,
        counts=tables.segments.counts,
        actions=tables.segments.actions,
        grid=timeline.grid,
        slots=tables.slots,
        gain=gain,
        bias=bias,
        holds=_together(holds),
        reach=timeline.reach,
        origin=timeline.origin,
        snapshots=tables.snapshots,
        following=following,
        advance=tables.segments.advance,
    )


@lru_cache(2)
def _ones(count: int) -> np.ndarray:
    """So many: the parts of a long log have as many samples as those before, and nobody writes to them."""
    found = np.ones(count)
    found.flags.writeable = False
    return found


def _together(parts: Sequence[np.ndarray]) -> np.ndarray:
    """One after the other; of a single one that has numbers the array itself."""
    some = [part for part in parts if part.size]
    return some[0] if len(some) == 1 else np.concatenate([np.zeros(0), *some])


def _recorded(channels: Sequence[Channel], samples: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """What arrives in every channel, from what arrives of every output."""
    known = {id(channel): np.asarray(values, dtype=float) for channel, values in zip(channels, samples, strict=False)}
    for channel in channels:
        if isinstance(channel, HeardOtherwise):
            yield known[id(channel.source)][channel.which]
        else:
            yield known[id(channel)]
