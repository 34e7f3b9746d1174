"""Plant and observers as one hybrid system: the structure that the engine compiles, and its numbers.

Numbers (parameters, gains, noise amplitudes, saturation bounds) are run-time arguments of the compiled
code; what is built in is the structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.engine.layout import (
    BEFORE_S,
    CONTINUOUS,
    DELAYED,
    HELD,
    NOISE,
    OUTPUT,
    PREVIOUS,
    SILENT,
    Structure,
    Variant,
    is_delayed,
)
from hgorun.observers.base import AnyObserver, Sample, SampledObserver
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.symbolic.forms import Form
from hgorun.symbolic.parameters import Parameters


@dataclass(frozen=True)
class Signal:
    """A continuous output in one phase: v(t) without its held part, how it enters, and the delay."""

    noise: ca.SX
    multiplicative: bool
    delay: ca.SX


@dataclass(frozen=True)
class System:
    """The whole system.

    Attributes
    ----------
    structure : Structure
        For the engine.
    p, z0 : ndarray
        Numbers of this run: parameters and initial state.
    observers : list of ObserverBlock
    report : casadi.Function
        (t, p, z) -> (u, y, xhat of every observer in the plant's coordinates).
    """

    plant: BuiltPlant
    structure: Structure
    p: np.ndarray
    z0: np.ndarray
    observers: list[ObserverBlock]
    report: ca.Function


def build_system(
    plant: BuiltPlant,
    forms: Mapping[str, Form],
    observers: Mapping[str, AnyObserver],
    signals: Mapping[tuple[int, int], Signal],
    variants: Sequence[Variant],
    parameters: Parameters,
    plant_symbol: ca.SX,
) -> System:
    """Put plant and observers together.

    Parameters
    ----------
    forms : mapping of str to Form
        Of every observer.
    signals : mapping of (output, phase) to Signal
        The continuous outputs.
    variants : sequence of Variant
        The combinations of availabilities that occur.
    parameters : Parameters
        Already holding the plant's parameters (``plant_symbol``) and the noise's.

    Raises
    ------
    Problem
        When an observer's block does not fit the plant.
    """
    model = plant.model
    t, n, q = model.t, model.n, len(model.outputs)
    has_alpha = any(what in (HELD, DELAYED) for variant in variants for what, _ in variant)
    blocks: list[ObserverBlock] = []
    start = n
    for label, observer in observers.items():
        blocks.append(ObserverBlock(label, observer, forms[label], start, has_alpha, parameters))
        start = blocks[-1].end
    z = ca.SX.sym("z", start)
    width = BEFORE_S + len(blocks)
    w = ca.SX.sym("w", q * width + 1)
    p = parameters.symbol
    u = ca.substitute(plant.inputs, model.p, plant_symbol)
    disturbance = ca.substitute(plant.disturbance, model.p, plant_symbol)
    x = z[:n]
    y = model.h(t, x, u, plant_symbol)
    stepped = plant.block.discretise == "euler"
    dx = ca.SX.zeros(n) if stepped else model.f(t, x, u, plant_symbol) + disturbance
    guesses = [b.guess(t, u, plant_symbol, z) for b in blocks]
    alphas = [b.symbols(z).alpha if has_alpha else ca.SX.zeros(q) for b in blocks]

    def innovation(j: int, variant: Variant) -> ca.SX:
        """C xhat(t-d) - y_d(t) + alpha(t) - alpha(t-d), output by output."""
        parts = []
        for i, (what, phase) in enumerate(variant):
            held = w[i * width : (i + 1) * width]
            s = held[BEFORE_S + j]
            if what == SILENT:
                parts.append(ca.SX(0))
            elif what == HELD:
                parts.append(s + alphas[j][i] - held[OUTPUT])
            elif what == CONTINUOUS:
                parts.append(guesses[j][i] - _measured(y[i], held[NOISE], signals[i, phase]))
            else:
                parts.append(s + alphas[j][i] - _measured(held[OUTPUT], held[NOISE], signals[i, phase]))
        return ca.vertcat(*parts)

    def compiled(name: str, expression: ca.SX, last: ca.SX = w) -> ca.Function:
        return ca.Function(name, [t, p, z, last], [ca.densify(ca.cse(expression))])

    flows = {}
    for v in variants:
        parts = [b.flow(t, u, plant_symbol, z, innovation(j, v)) for j, b in enumerate(blocks)]
        flows[v] = compiled("flow", ca.vertcat(dx, *parts))
    lags = {
        v: compiled(
            "lags",
            ca.vertcat(*[signals[i, ph].delay if what == DELAYED else 0 for i, (what, ph) in enumerate(v)]),
        )
        for v in variants
        if is_delayed(v)
    }
    channels = ca.vertcat(
        *[ca.vertcat(y[i], *[g[i] - a[i] for g, a in zip(guesses, alphas, strict=True)]) for i in range(q)]
    )
    dz = ca.SX.sym("dz", start)
    slopes = ca.jtimes(channels, z, dz) + ca.jacobian(channels, t)
    sample = Sample(
        y=ca.vertcat(*[w[i * width + OUTPUT] for i in range(q)]),
        previous=ca.vertcat(*[w[i * width + PREVIOUS] for i in range(q)]),
        interval=w[-1],
    )
    u_before = ca.substitute(u, t, t - sample.interval)
    jumps = [
        (b.start, b.end, compiled("jump", b.jump(t, u, u_before, plant_symbol, z, sample)))
        for b in blocks
        if isinstance(b.observer, SampledObserver)
    ]
    if stepped:
        rate = model.f(t - sample.interval, x, u_before, plant_symbol)
        rate += ca.substitute(disturbance, t, t - sample.interval)
        jumps.insert(0, (0, n, compiled("step", x + sample.interval * rate)))
    structure = Structure(
        states=start,
        plant_states=n,
        held=w.numel(),
        parameters=p.numel(),
        outputs=q,
        observers=len(blocks),
        has_alpha=has_alpha,
        blocks=tuple((b.start, b.stop, b.end) for b in blocks),
        flows=flows,
        lags=lags,
        channels=compiled("channels", channels),
        channel_slopes=compiled("trace", ca.vertcat(channels, slopes), dz),
        jumps=tuple(jumps),
    )
    estimates = [b.estimate(t, u, plant_symbol, z) for b in blocks]
    report = ca.Function("report", [t, p, z], [ca.densify(e) for e in (u, y, *estimates)])
    z0 = np.concatenate([plant.initial, *[b.initial(plant) for b in blocks]])
    return System(plant, structure, parameters.values, z0, blocks, report)


def _measured(y: ca.SX, held: ca.SX, signal: Signal) -> ca.SX:
    v = signal.noise + held
    return y * (1 + v) if signal.multiplicative else y + v
