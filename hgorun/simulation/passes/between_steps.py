"""What the steps of a run may have passed over: features of the equations that are narrow in a state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.errors import SimulationError
from hgorun.memo import Memo, same
from hgorun.pieces import distinct
from hgorun.result.records.data import PLANT
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.passes.passes import Pass, carry_out, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.structure import Structure
from hgorun.simulation.timeline.steps import steps_between
from hgorun.symbolic.crossings import TooMany
from hgorun.symbolic.curves import Curve
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.features import Feature
from hgorun.symbolic.narrow import features_of
from hgorun.symbolic.passages import Passages, between

SMOOTH = "a smooth law, such as tanh(s/eps) in place of sign(s)"  # what to write of equations that jump
_CELLS = 1 << 14  # of a run with controlled steps, whose times are not known
_NUMBERS = 6e6  # that are recorded of a run: with more steps than that a cell has several
_ROWS = 8  # of the output grid are looked at together
_SHORT = 1e-2  # of a run: what lasts longer is seen by every controlled step

_NONE: Mapping[str, float] = MappingProxyType({})

_FEATURES: Memo[dict[str, tuple[Feature, ...]]] = Memo(64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Missed:
    """What may be wrong with a pass although its error seems small.

    Attributes
    ----------
    narrow : dict of str to ndarray
        When the plant, or an observer, passes something between two evaluations of the equations.
    lagging : dict of str to ndarray
        When an observer and the plant pass jumps between two evaluations: that one does so later is not seen.
    jumps : bool
        Whether jumps are passed at all, which fixed steps are not accurate at.
    countless : bool
        Whether there are too many passages to tell.
    """

    narrow: Mapping[str, Floats] = field(default_factory=dict)
    lagging: Mapping[str, Floats] = field(default_factory=dict)
    jumps: bool = False
    countless: bool = False

    @property
    def nothing(self) -> bool:
        """Whether nothing speaks against the pass."""
        return not (self.narrow or self.lagging or self.jumps or self.countless)


def may_jump(run: PreparedRun) -> bool:
    """Whether equations are not continuous somewhere in the space of states."""
    return bool(jumping(run))


def jumping(run: PreparedRun) -> frozenset[str]:
    """Whose equations are not continuous somewhere in the space of states: the plant, and observers."""
    return frozenset(label for label, own in _features_of(run).items() if any(feature.jump for feature in own))


def jumps_of(run: PreparedRun, label: str) -> str:
    """What jumps in the equations of the plant or of an observer, and in which states: ``sign of v``."""
    model, told = run.plant.model, dict[str, None]()
    for feature in _features_of(run).get(label, ()):
        if feature.jump and feature.operation:
            own = [model.states[k] for k in feature.states if k < model.n]
            whose = ["estimates"] if any(k >= model.n for k in feature.states) else []
            told[f"{feature.operation} of {', '.join([*own, *whose])}"] = None
    return "; ".join(told)


def _features_of(run: PreparedRun) -> dict[str, tuple[Feature, ...]]:
    return _FEATURES.get(same(run.structure), lambda: _features(run.structure))


def may_miss(run: PreparedRun, p: Floats, grid: Floats, rows: Floats) -> np.ndarray:
    """Which of several runs of one structure may pass something between steps, from what is known on a grid.

    Parameters
    ----------
    run : PreparedRun
        One of them.
    p : ndarray, shape (parameters, N)
    grid : ndarray, shape (Nt,)
    rows : ndarray, shape (Nt, states, N)

    Returns
    -------
    ndarray of bool, shape (N,)
    """
    found = np.zeros(rows.shape[2], dtype=bool)
    features = [feature for own in _features_of(run).values() for feature in own]
    if not features or len(grid) < 2:
        return found
    first = np.arange(0, len(grid) - 1, _ROWS)
    last = np.append(first[1:], len(grid) - 1)
    groups = [rows[a : b + 1] for a, b in zip(first, last, strict=True)]
    least, most = (np.stack([side(group, axis=0) for group in groups]) for side in (np.min, np.max))
    beyond = 0.5 * (most - least)
    for feature in features:
        near = feature.near(grid[first], grid[last], least - beyond, most + beyond, p)
        found |= np.any(near, axis=0)
    return found


def missed(run: PreparedRun, how: Pass, lost: Mapping[str, float] = _NONE) -> Missed:
    """What the steps of a pass may have passed over.

    Parameters
    ----------
    lost : mapping of str to float, optional
        From when on it does not matter what an observer passes; from the start on where it is -inf.
    """
    features = {label: own for label, own in _features_of(run).items() if lost.get(label, 0.0) > -np.inf}
    if not any(features.values()):
        return Missed()
    low, high, seen = _cells(run, how)
    step = int(_SHORT * _CELLS) if how.tolerance else 1
    try:
        curve = _curve(run, how, low, high)
        found = {
            label: Passages.of(own, _until(curve, lost.get(label)), run.numbers.p, seen, step)
            for label, own in features.items()
            if own
        }
    except (TooMany, SimulationError):
        return Missed(countless=True)
    longest = _SHORT * run.span if how.tolerance else how.step
    narrow = {label: of.narrow(seen, longest) for label, of in found.items()}
    lagging = {} if how.tolerance or PLANT not in found else _lagging(found, seen)
    return Missed(
        narrow={label: times for label, times in narrow.items() if times.size},
        lagging={label: times for label, times in lagging.items() if times.size},
        jumps=not how.tolerance and any(of.jumps.size for of in found.values()),
    )


def _until(curve: Curve, end: float | None) -> Curve:
    """A trajectory up to the cell in which a time lies."""
    return curve if end is None else curve.where(curve.low < end)


def _lagging(found: Mapping[str, Passages], seen: Floats) -> dict[str, Floats]:
    """When jumps of an observer and of the plant are passed between two evaluations."""
    plant = found[PLANT].jumps
    return {
        label: between(distinct(np.concatenate([plant, of.jumps])), seen)
        for label, of in found.items()
        if label != PLANT and of.jumps.size
    }


def _features(structure: Structure) -> dict[str, tuple[Feature, ...]]:
    """Of the plant, and of every observer with a flow, those that depend on its states or on both."""
    system = structure.system
    flows = [regime.flow for regime in system.regimes]
    jumping = {k for a, b, _ in system.jumps for k in range(a, b)}
    plant = set(range(system.plant_states)) - jumping
    found = {PLANT: features_of(flows, sorted(plant))}
    for block, (start, *_) in zip(structure.observers, system.blocks, strict=True):
        own = set(range(start, block.end)) - jumping
        found[block.label] = tuple(f for f in features_of(flows, sorted(own | plant)) if own & set(f.states))
    return found


def _cells(run: PreparedRun, how: Pass) -> tuple[Floats, Floats, Floats]:
    """The parts of time on which the trajectory is a cubic, and the times of evaluation as far as they are known."""
    events = run.schedule.events
    if how.tolerance:
        steps = np.maximum(np.ceil(np.diff(events) * _CELLS / run.span), 1).astype(int)
    else:
        steps = steps_between(run.schedule, longest_step(run, how.step))
        steps = -(-steps // int(np.ceil(3.0 * np.sum(steps) * run.structure.system.states / _NUMBERS)))
    gap = np.repeat(np.arange(steps.size), steps)
    number = np.arange(gap.size) - np.repeat(np.cumsum(steps) - steps, steps)
    length = np.diff(events)[gap] / steps[gap]
    low = events[gap] + number * length
    high = np.append(low[1:], events[-1])
    if how.tolerance:
        return low, high, events
    stages = np.array(sorted({0.0, *METHODS[how.method].c} - {1.0}))
    return low, high, np.append((low[:, None] + stages * (high - low)[:, None]).ravel(), events[-1])


def _curve(run: PreparedRun, how: Pass, low: Floats, high: Floats) -> Curve:
    """The trajectory of a pass, carried out once more with records in every cell."""
    plan, start = plan_of(run, how)
    inner = low[:, None] + np.array([0, 1, 2]) / 3 * (high - low)[:, None]
    grid = np.append(inner.ravel(), high[-1])
    rows = carry_out(run, how, plan.with_grid(grid), start).rows[:, :, 0]
    values = np.stack([rows[k : k + 3 * low.size : 3] for k in range(4)], axis=1)
    return Curve.through(low, high, values)
