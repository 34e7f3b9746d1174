"""What a family of runs has in common: equations and compiled code, built once and kept in memory.

A structure depends on the plant's equations, on the forms in which the observers see it, on the observers'
classes and on how the outputs reach them; not on numbers. Two experiments of one structure share it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from hgorun.config.reads import Reads
from hgorun.engine.layout import HybridSystem
from hgorun.engine.program import Program
from hgorun.measurement.availability import Stretch
from hgorun.measurement.signals import Signal, signal, signal_numbers, signal_structure
from hgorun.measurement.variants import Variant
from hgorun.memo import Memo
from hgorun.observers.base import AnyObserver
from hgorun.result.evaluation.estimated import Estimated
from hgorun.simulation.design.design import Design
from hgorun.simulation.system.groups import Group
from hgorun.simulation.system.loop import DrivenPlant
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.readout import LoopReadout, Readout
from hgorun.simulation.system.system import build_system, has_past
from hgorun.simulation.system.truth import PlantNumbers, Truth
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.parameters import Parameters

if TYPE_CHECKING:
    from hgorun.engine.ensemble import Ensemble

Stretches = Sequence[Sequence[Stretch]]  # of every output of the plant


@dataclass(frozen=True, eq=False, repr=False)
class Structure:
    """The equations of a family of runs, and the code compiled from them.

    Attributes
    ----------
    groups : tuple of Group
        Their observers' numbers are those of the experiment that was built first.
    system : HybridSystem
        What is compiled.
    p, plant : casadi.SX
        All parameters, and those of the plant among them.
    signals : dict of (output, phase) to Signal
        The continuous outputs.
    inputs, outputs : Readout
        u and y of the first truth.
    estimates : tuple of Readout
        xhat of every observer in the plant's coordinates.
    loops : tuple of LoopReadout
        Where a controller drives the plant: with the true state, and then with every observer.
    reads : tuple of Reads
        The keys that the observers' equations depend on.
    spreads : tuple of Readout or None
        Of every observer that has a covariance P of its errors, what it expects of samples, see
        :meth:`~hgorun.simulation.system.observer_block.ObserverBlock.spread`; only where innovations are kept.
    """

    groups: tuple[Group, ...]
    system: HybridSystem
    p: ca.SX
    plant: ca.SX
    signals: dict[tuple[int, int], Signal]
    inputs: Readout
    outputs: Readout
    estimates: tuple[Readout, ...]
    reads: tuple[Reads[AnyObserver], ...]
    spreads: tuple[Readout | None, ...] = ()
    loops: tuple[LoopReadout, ...] = ()
    _programs: dict[Hashable, Program] = field(default_factory=dict, repr=False)
    _ensembles: dict[Hashable, Ensemble] = field(default_factory=dict, repr=False)

    def estimates_along(self, times: Floats, p: Floats, z: Floats, w: Floats | None = None) -> Estimated:
        """xhat of all observers along a run; arguments as of :meth:`Readout.along`."""
        known = [readout.places for readout in self.estimates]
        places = [of for of in known if of]
        if len(places) == len(known):
            return Estimated(z, places)
        n = self.groups[0].truth.plant.model.n
        values = np.concatenate([readout.along(times, p, z, w) for readout in self.estimates], axis=1)
        return Estimated(values, [list(range(j * n, (j + 1) * n)) for j in range(len(known))])

    @cached_property
    def truths(self) -> tuple[list[int], ...]:
        """For every observer the places in z of the states that it estimates."""
        n = self.groups[0].truth.plant.model.n
        starts = [group.truth_states.start for group in self.groups for _ in group.observers]
        return tuple(list(range(start, start + n)) for start in starts)

    @property
    def observers(self) -> tuple[ObserverBlock, ...]:
        """The observers of all groups."""
        return tuple(b for group in self.groups for b in group.observers)

    def holds_for(self, place: int, observer: AnyObserver) -> bool:
        """Whether another block of one of the observers has the same values at all keys that equations read."""
        return self.reads[place].hold_for(observer)

    def depends_on_input(self, number: int) -> bool:
        """Whether a recorded input appears in what happens to the observers, or in their estimates."""
        system, places = self.system, set(self.system.held.input(number))
        functions = [one.flow for one in system.regimes] + [one for _, _, one in system.jumps]
        functions += [system.channels, *(one.function for one in self.estimates)]
        return any(
            places & set(one.jac_sparsity(0, 3).get_col()) for one in functions if one.size1_in(3) and one.numel_out(0)
        )

    @property
    def compiled(self) -> bool:
        """Whether there is native code of it already."""
        return bool(self._programs)

    def program(self, method: str, *, adaptive: bool = False, lanes: int = 1) -> Program:
        """Native code for a method of integration, compiled when first asked for."""
        key = method, adaptive, lanes
        if key not in self._programs:
            self._programs[key] = Program(self.system, method, adaptive=adaptive, lanes=lanes)
        return self._programs[key]

    def ensemble(self, method: str, lanes: int | None = None) -> Ensemble:
        """Many runs side by side, with fixed steps; ``lanes`` as of :class:`hgorun.engine.ensemble.Ensemble`."""
        from hgorun.engine.ensemble import Ensemble  # single runs do without it

        key = method, lanes
        if key not in self._ensembles:
            self._ensembles[key] = Ensemble(self.system, method, lanes)
        return self._ensembles[key]


_STRUCTURES: Memo[list[Structure]] = Memo(128)  # a live page looks ahead to twenty orders of some observers
_BUCKET = 16  # structures of one key, which differ in keys that the observers' equations read; the last used ones


def structure_of(
    truths: Sequence[Truth],
    designs: Sequence[Sequence[Design]],
    stretches: Stretches,
    variants: Sequence[Variant],
    parameters: np.ndarray,
    *,
    innovations: bool = False,
    variances: bool = False,
) -> Structure:
    """The structure of a run, built where none is known.

    Parameters
    ----------
    truths : sequence of Truth
        One a group; all of them of one plant.
    designs : sequence of sequence of Design
        The observers of every group.
    stretches : sequence of sequence of Stretch
        Of every output of the plant: the truths share them.
    variants : sequence of Variant
        The combinations of availabilities that occur.
    parameters : ndarray
        The plant's, with the numbers of its expressions.
    innovations : bool
        Whether every observer's innovation is kept of every sample that arrives.
    variances : bool
        Whether the variance of what it says of the output is kept as well, where it knows that.
    """
    key = (
        tuple((truth.structure, *(d.structure for d in of)) for truth, of in zip(truths, designs, strict=True)),
        tuple(tuple(map(signal_structure, one)) for one in stretches),
        tuple(variants),
        innovations,
        variances,
    )
    bucket = _STRUCTURES.get(key, list)
    observers = [d.observer for d in chain(*designs)]
    for structure in bucket:
        if all(structure.holds_for(place, observer) for place, observer in enumerate(observers)):
            bucket[:] = [*(other for other in bucket if other is not structure), structure]
            return structure
    reads = [Reads(observer) for observer in observers]
    structure = _build(truths, designs, reads, stretches, variants, parameters, innovations, variances)
    bucket.append(structure)
    del bucket[:-_BUCKET]
    return structure


def parameter_values(parameters: np.ndarray, stretches: Stretches, designs: Sequence[Design]) -> np.ndarray:
    """The numbers of the vector p, in the order in which :func:`structure_of` has given them symbols."""
    signals = [signal_numbers(s) for one in stretches for s in one if s.continuous]
    return np.concatenate([parameters, *signals, *(d.numbers for d in designs)])


def _build(
    truths: Sequence[Truth],
    designs: Sequence[Sequence[Design]],
    reads: Sequence[Reads[AnyObserver]],
    stretches: Stretches,
    variants: Sequence[Variant],
    values: np.ndarray,
    innovations: bool,
    variances: bool,
) -> Structure:
    plant, parameters = truths[0].plant, Parameters()
    t = plant.model.t
    count = plant.model.p.numel()
    symbols = PlantNumbers(parameters.add("plant", values[:count]), parameters.add("numbers", values[count:]))
    of_one = {
        (i, k): signal(s, t, parameters, f"noise.{i}.{k}")
        for i, one in enumerate(stretches)
        for k, s in enumerate(one)
        if s.continuous
    }
    signals = {(g * len(stretches) + i, k): s for g in range(len(truths)) for (i, k), s in of_one.items()}
    groups, start, watched = [], 0, iter(reads)
    for truth, of in zip(truths, designs, strict=True):
        blocks, end = [], start + truth.size
        for design in of:
            blocks.append(ObserverBlock.place(design, end, has_past(variants), parameters, next(watched).watched))
            end = blocks[-1].end
        groups.append(Group(truth, start, tuple(blocks)))
        start = end
    p = parameters.symbol
    system = build_system(groups, t, p, symbols, signals, variants, innovations=innovations)
    z, w = ca.SX.sym("z", system.states), ca.SX.sym("w", system.held.size)
    symbolic = t, p, z, w
    estimates: list[Readout] = []
    spreads: list[Readout | None] = []
    loops: list[LoopReadout] = []
    for group in groups:
        placed = group.placed(t, z, symbols, w, system.held)
        for b in group.observers:
            xhat = b.states["xhat"]
            shown = b.estimate(t, placed.u, symbols.parameters, z)
            estimates.append(Readout.of(shown, symbolic, range(xhat.start, xhat.start + xhat.size)))
            spread = b.spread(t, placed.u, symbols.parameters, z) if innovations else None
            spreads.append(None if spread is None else Readout.of(spread, symbolic, ()))
        u, y = Readout.of(placed.u, symbolic, ()), Readout.of(placed.y, symbolic, _places(group.truth_states))
        if group is groups[0]:
            inputs, outputs = u, y
        if isinstance(group.truth, DrivenPlant):
            states, whole = group.truth.states, _places(group.truth_states)
            loops.append(
                LoopReadout(
                    x=whole[: states.n],
                    integral=whole[states.integral],
                    effort=whole[states.effort],
                    cost=whole[states.cost.start] if states.costs else None,
                    inputs=u,
                    outputs=y,
                )
            )
    if variances and any(spreads):
        system = replace(system, spreads=_spreads(symbolic, groups, spreads))
    return Structure(
        tuple(groups),
        system,
        p,
        symbols.parameters,
        signals,
        inputs,
        outputs,
        tuple(estimates),
        tuple(reads),
        tuple(spreads),
        tuple(loops),
    )


def _spreads(symbolic: Sequence[ca.SX], groups: Sequence[Group], spreads: Sequence[Readout | None]) -> ca.Function:
    """The variances of all outputs of all groups, for each observer, which are zero where nothing is known."""
    q = len(groups[0].truth.plant.model.outputs)
    known = ca.horzcat(*(ca.SX(q, 1) if one is None else one.function(*symbolic)[:q] for one in spreads))
    return ca.Function("spreads", list(symbolic), [ca.densify(ca.vec(ca.repmat(known, len(groups), 1).T))])


def _places(states: slice) -> list[int]:
    return list(range(states.start, states.stop))
