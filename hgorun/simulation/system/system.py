"""Truths and observers as one hybrid system: what the engine compiles.

Numbers (parameters, gains, noise amplitudes, saturation bounds) are run-time arguments of the compiled code;
what is built in is the structure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate

import casadi as ca

from hgorun.engine.layout import Decision, Held, HybridSystem, Regime
from hgorun.errors import Problem
from hgorun.measurement.signals import Signal
from hgorun.measurement.variants import DELAYED, HELD, Variant, is_delayed
from hgorun.observers.base import CorrectedObserver
from hgorun.observers.capabilities import RecallsInputs
from hgorun.observers.recalling import RecallingObserver
from hgorun.simulation.system.groups import Group, Part, SystemSymbols
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.truth import PlantNumbers, SameTruth, SimulatedPlant


def build_system(
    groups: Sequence[Group],
    t: ca.SX,
    p: ca.SX,
    plant: PlantNumbers,
    signals: Mapping[tuple[int, int], Signal],
    variants: Sequence[Variant],
    *,
    innovations: bool = False,
) -> HybridSystem:
    """Put truths and observers together.

    The states of a truth other than the first are watched together with those of its first observer: in a
    closed loop, where each observer drives a copy of the plant, they diverge together.

    Parameters
    ----------
    groups : sequence of Group
        One after the other in z. Their outputs are numbered through.
    t, p : casadi.SX
        Time, and all parameters.
    plant : PlantNumbers
        Those of the plant among them.
    signals : mapping of (output, phase) to Signal
        The continuous outputs.
    variants : sequence of Variant
        The combinations of availabilities that occur.
    innovations : bool
        Whether every observer's innovation is kept of every sample that arrives.
    """
    has_alpha = has_past(variants)
    several = len(groups) > 1
    size = groups[-1].end + several  # where there are several groups the last state is zero for ever
    widths = [len(group.truth.plant.model.outputs) for group in groups]
    counts = [len(group.observers) for group in groups]
    recorded = max(group.truth.recorded_inputs for group in groups)
    recalled = _recalled(groups, sum(widths))
    lags = ca.vertcat(ca.SX(0, 1), *[b.k.lags for group in groups for b in group.observers if b.recalled])
    held = Held(sum(widths) + lags.numel(), sum(counts), recorded, flags=_has_corrected(groups))
    symbols = SystemSymbols(t, ca.SX.sym("z", size), ca.SX.sym("w", held.size), p, plant, held)
    z, w = symbols.z, symbols.w
    starts = zip(accumulate([0, *widths]), accumulate([0, *counts]), strict=True)
    parts = [
        Part(group, symbols, *start, has_alpha, of) for group, start, of in zip(groups, starts, recalled, strict=False)
    ]

    def compiled(name: str, expression: ca.SX, last: ca.SX = w) -> ca.Function:
        return ca.Function(name, [t, p, z, last], [ca.densify(ca.cse(expression))])

    regimes = []
    for variant in variants:
        rates = [rate for part in parts for rate in part.flow(variant, signals)]
        flow = compiled("flow", ca.vertcat(*rates, *[ca.SX(0)] * several))
        decided = {k: v for part in parts for k, v in part.decisions(variant, signals).items()}
        decision = None
        if decided:
            decision = Decision(tuple(decided), compiled("decision", ca.vertcat(*decided.values())))
        if is_delayed(variant) or lags.numel():
            delays = [signals[i, phase].delay if what == DELAYED else 0 for i, (what, phase) in enumerate(variant)]
            late = tuple(i for i, (what, _) in enumerate(variant) if what == DELAYED)
            own = tuple(range(len(variant), held.outputs))
            regimes.append(Regime(flow, compiled("lags", ca.vertcat(*delays, lags)), late + own, decision))
        else:
            regimes.append(Regime(flow, decision=decision))
    own_signals = ca.vertcat(ca.SX(0, 1), *[signal for part in parts for signal in part.signals()])
    channels = ca.vertcat(
        *[channel for part in parts for channel in part.channels(held.observers)],
        *[ca.vertcat(signal, ca.SX.zeros(held.observers)) for signal in ca.vertsplit(own_signals) if signal.numel()],
    )
    dz = ca.SX.sym("dz", size)
    slopes = ca.SX(0, 1)
    if any(regime.delayed for regime in regimes):
        slopes = ca.vertcat(channels, ca.jtimes(channels, z, dz) + ca.jacobian(channels, t))
    jumps = [(a, b, compiled("jump", new)) for part in parts for a, b, new in part.jumps()]
    acts = [(a, b, compiled("act", new)) for part in parts for a, b, new in part.acts()]
    keeps = [(a, b, compiled("keep", new)) for part in parts for a, b, new in part.keeps()]
    corrections = [(part.outputs, a, b, compiled("jump", new)) for part in parts for a, b, new in part.corrections()]
    first = len(jumps) + len(acts) + len(keeps)
    return HybridSystem(
        states=size,
        plant_states=groups[0].truth.size,
        parameters=p.numel(),
        held=held,
        blocks=tuple(block for i, group in enumerate(groups) for block in _blocks(group, first=i == 0)),
        alpha=(*_alpha(groups, size - 1), *[(size - 1,) * held.observers] * lags.numel()) if has_alpha else (),
        regimes=tuple(regimes),
        channels=compiled("channels", channels),
        channel_slopes=compiled("trace", slopes, dz),
        jumps=(*jumps, *acts, *keeps, *((a, b, new) for _, a, b, new in corrections)),
        acts=len(acts),
        keeps=len(keeps),
        corrections=tuple((first + i, of.start, of.stop) for i, (of, *_) in enumerate(corrections)),
        replayed=_replayed(groups[-1], held, parts[-1].outputs.start),
        innovations=innovations,
        recalled=lags.numel(),
    )


def _recalled(groups: Sequence[Group], first: int) -> list[list[range]]:
    """Of every observer of every group the outputs from ``first`` on that stand for what it looks back at."""
    found = []
    for group in groups:
        own = []
        for b in group.observers:
            own.append(range(first, first + b.recalled))
            first += b.recalled
            truth = group.truth.truth if isinstance(group.truth, SameTruth) else group.truth
            if isinstance(b.observer, RecallsInputs):
                _require_timed(b, truth.untimed)
            if isinstance(b.observer, RecallingObserver) and not isinstance(truth, SimulatedPlant):
                message = (
                    "it looks back at its own past, which is kept in simulations alone, not of data or a stream: take "
                    "shgo, whose innovation takes samples that are late"
                )
                raise Problem(("observers", b.label, "type"), message)
        found.append(own)
    return found


def _require_timed(b: ObserverBlock, untimed: Sequence[int]) -> None:
    """Refuse inputs of which nothing is known but what they are now."""
    plant = b.form.plant
    names = [plant.inputs[i] for i in untimed if plant.depends_on_input(i)]
    if names:
        raise Problem(
            ("observers", b.label, "type"),
            "it asks for the inputs of times before, which have to be functions of time, not data or a law: "
            f"{', '.join(names)}",
        )


def _replayed(last: Group, held: Held, output: int) -> tuple[int, int] | None:
    """From where on states and held numbers are those of observers that are taken back, which come last."""
    if isinstance(last.truth, SameTruth) and last.truth.replayed:
        return last.start, held.noise(output)
    return None


def _has_corrected(groups: Sequence[Group]) -> bool:
    """Whether an observer is corrected by some of its outputs at a time."""
    return any(isinstance(b.observer, CorrectedObserver) for group in groups for b in group.observers)


def has_past(variants: Sequence[Variant]) -> bool:
    """Whether the observers compare with the past, and need alpha for it."""
    return any(what in (HELD, DELAYED) for variant in variants for what, _ in variant)


def _blocks(group: Group, *, first: bool) -> Iterator[tuple[int, int, int]]:
    """Which states are watched for divergence with each observer, and where its alpha ends."""
    for i, b in enumerate(group.observers):
        yield (group.start if i == 0 and not first else b.start), b.stop, b.end


def _alpha(groups: Sequence[Group], nothing: int) -> tuple[tuple[int, ...], ...]:
    """For each output where every observer's alpha lies; observers of other groups have none."""
    return tuple(
        tuple(
            b.states["alpha"].start + output if other is group else nothing for other in groups for b in other.observers
        )
        for group in groups
        for output in range(len(group.truth.plant.model.outputs))
    )
