"""The first instant of a run: every right-hand side has to be a number there, and if one is not, what is to blame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.checks.far_start import huge_start
from hgorun.simulation.design.first_inputs import Recorded
from hgorun.simulation.design.overflow import moderate, overflow
from hgorun.simulation.plant_alone import divided_by_zero
from hgorun.simulation.prepared import Numbers
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.structure import Structure
from hgorun.symbolic.domains import first_undefined, too_large
from hgorun.symbolic.evaluate import Floats, roughly_at

_MANY = 8  # states that a message names with their numbers


class Beginning(Protocol):
    """What is known of a run when it begins; a stream has no more."""

    @property
    def plant(self) -> BuiltPlant:
        """The plant with its numbers."""

    @property
    def time(self) -> Time:
        """Counted from the start of the run."""

    @property
    def structure(self) -> Structure:
        """All equations."""

    @property
    def numbers(self) -> Numbers:
        """Those that they begin with."""

    @property
    def recorded(self) -> Recorded:
        """How inputs that come with the data begin."""


def check_start(run: Beginning) -> None:
    """The right-hand sides must be numbers at the start.

    Raises
    ------
    Problem
        Where one is not; it names the operation that is not defined, or whose result is too large, and the states.
    """
    system, numbers = run.structure.system, run.numbers
    sound = np.isfinite(_rates(run, numbers.p, numbers.z0))
    if sound.all():
        return
    bad = np.flatnonzero(~sound[: system.plant_states])
    if bad.size:
        if bad[0] >= run.plant.model.n:
            raise Problem(
                ("controller",),
                "what its law or its cost gives is not a finite number at the start of the run" + _why(run, bad)[0],
            )
        name = run.plant.model.states[int(bad[0])]
        path = ("plant", *run.plant.block.place_of(name))
        if (why := divided_by_zero(run.plant, path)) is not None:
            raise Problem(path, why)
        what = f"the right-hand side of {name} is not a finite number at the start of the run"
        why, large = _why(run, bad[:1])
        far = huge_start(run.plant) if large else None
        if far is not None:
            raise Problem(("plant", "initial", far[0]), f"{far[1]:.6g} is too large: {what}{why}")
        raise Problem(path, what + why)
    check_outputs(run)
    for b, (first, *_) in zip(numbers.observers, system.blocks, strict=True):
        if not sound[first : b.start].all():
            raise Problem(
                ("observers", b.label),
                "at its initial estimate the controller's law is not a finite number; set it with initial",
            )
        own = np.arange(b.start, b.end)
        if not sound[own].all():
            beyond = overflow(b.label, b.observer)
            if beyond is not None and np.isfinite(_rates(run, moderate(numbers.p), moderate(numbers.z0))[own]).all():
                raise beyond
            internal = ", ".join(name for name in b.states if name not in ("xhat", "alpha"))
            what, large = _why(run, own, b)
            whose = f"its initial estimate or its internal state ({internal})" if internal else "its initial estimate"
            why = (
                "is too large" if large else "lies where the equations are singular; set them with initial and internal"
            )
            raise Problem(
                ("observers", b.label),
                f"the observer's right-hand side is not a finite number at the start of the run{what}: {whose} {why}",
            )


def check_outputs(run: Beginning) -> None:
    """The outputs must be numbers at the start, as at every later point of the run.

    An observer may not be a number since what it measures is none, at once or after its first sample.

    Raises
    ------
    Problem
    """
    numbers, model = run.numbers, run.plant.model
    (y,) = run.structure.outputs.along(np.array([run.time.start]), numbers.p, numbers.z0[None, :])
    for name, value in zip(model.outputs, y, strict=True):
        if not np.isfinite(value):
            at = _numbers(model.states, numbers.z0[: model.n])
            raise Problem(("plant",), f"output {name} is not a finite number at the start of the run, at {at}")


def _why(run: Beginning, rows: Sequence[int] | np.ndarray, block: ObserverBlock | None = None) -> tuple[str, bool]:
    """What to add to a message: the operation that is to blame, and where; and whether its result is too large."""
    numbers, model = run.numbers, run.plant.model
    flow = run.structure.system.regimes[0].flow
    given = [np.ravel(part) for part in (run.time.start, numbers.p, numbers.z0, _held_at_start(run))]
    symbols = [ca.SX.sym("s", flow.size1_in(i)) for i in range(4)]
    z = symbols[2]
    names = [(z[i], name) for i, name in enumerate(model.states)]
    states, values = list(model.states), numbers.z0[: model.n]
    if block is not None:
        xhat, own = block.states["xhat"], block.form.saturable(block.canonical)
        if len(own) != xhat.size:
            return "", False
        names += [(z[xhat.start + i], f"estimate of {name}") for i, name in enumerate(own)]
        states, values = list(own), numbers.z0[xhat.start : xhat.start + xhat.size]
    expression = flow(*symbols)[[int(row) for row in rows]]
    what = first_undefined(expression, symbols, given, names)
    large = too_large(expression, symbols, given) if what is None else None
    at = f"at {_numbers(states, values)}"
    return (f": {what or large}, {at}" if what or large else f", {at}"), large is not None


def _numbers(names: Sequence[str], values: Floats) -> str:
    shown = [f"{name} = {value:.6g}" for name, value in zip(names, values.tolist(), strict=True)]
    return ", ".join(shown[:_MANY] + (["..."] if len(shown) > _MANY else []))


def _held_at_start(run: Beginning) -> np.ndarray:
    """The vector w as if every output had just been measured."""
    system, layout = run.structure.system, run.structure.system.held
    held = np.zeros(layout.size)
    (channels,) = roughly_at(system.channels, run.time.start, run.numbers.p, run.numbers.z0, held)
    for i in range(system.outputs):
        first, output = i * system.width, layout.output(i)
        held[layout.previous(i)] = channels[first]
        held[output : output + system.width] = channels[first : first + system.width]
    for number, (_, value, slope) in enumerate(run.recorded):
        now, rate, _, before = layout.input(number)
        held[[now, rate, before]] = value, slope, value
    held[layout.interval] = 1.0
    return held


def _rates(run: Beginning, parameters: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The right-hand sides at the start."""
    flow = run.structure.system.regimes[0].flow
    (rates,) = roughly_at(flow, run.time.start, parameters, z, _held_at_start(run))
    return np.asarray(rates)
