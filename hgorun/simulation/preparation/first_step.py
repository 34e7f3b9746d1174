"""The step that is given, or the one with which error control begins."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.memo import Memo
from hgorun.observers.base import AnyObserver
from hgorun.plants.build import BuiltPlant, SymbolicPlant
from hgorun.plants.control import ControlLaw
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import evaluate
from hgorun.symbolic.forms import Form

PART = 0.05
"""Of 1/rate: a step."""
_SLOPES: Memo[ca.Function] = Memo(64)


def nominal_step(experiment: Experiment) -> float:
    """The step that is given, or the one with which error control begins.

    That follows from the fastest declared frequency and the fastest error dynamics at the start: RK4 follows
    exp(-rate t) to about 1e-7 of a step when rate * step is 0.05, and a sinusoid to the same with 60 points a period.
    It is the span over a power of two, up to twice as long as that and at least 2^-10 of the run; Euler's method
    takes steps 100 times as short. What takes more than 2^20 of them begins with these.
    """
    if experiment.given_step is not None:
        return experiment.given_step
    rates = [rate_of(label, design.observer, design.form) for label, design in experiment.designs.items()]
    rates += plant_rates(experiment.plant, experiment.time, experiment.plant.initial, experiment.plant.everything)
    return step_for(experiment, max((rate for rate in rates if np.isfinite(rate)), default=0.0))


def rate_of(label: str, observer: AnyObserver, form: Form) -> float:
    """The fastest rate of an observer's error dynamics; not finite or zero where it is not known."""
    try:
        return float(observer.fastest_rate(form))
    except Problem as problem:
        raise Problem(("observers", label, *problem.path), problem.message) from problem


def plant_rates(plant: BuiltPlant, time: Time, initial: np.ndarray, everything: np.ndarray) -> list[float]:
    """The fastest rate of a plant at the start of one run or of several; NaN where it is not known.

    Parameters
    ----------
    initial : ndarray, shape (n,) or (N, n)
    everything : ndarray, shape (parameters,) or (N, parameters)
    """
    slopes = _SLOPES.get(plant.symbolic, lambda: _slopes(plant.symbolic))
    (matrices,) = evaluate(slopes, np.array([time.start]), initial, everything)
    matrices = matrices.reshape(-1, plant.model.n, plant.model.n)
    known = np.all(np.isfinite(matrices), axis=(1, 2))
    rates = np.full(len(matrices), np.nan)
    rates[known] = np.max(np.abs(np.linalg.eigvals(matrices[known])), axis=1)
    return [float(rate) for rate in rates]


def step_for(experiment: Experiment, rate: float) -> float:
    """The step that a fastest rate asks for, where none is given."""
    time = experiment.time
    span = time.end - time.start
    step = span / 1000
    if rate > 0:
        step = min(step, PART / rate)
    for stretches in experiment.stretches:
        for s in stretches:
            fastest = s.fastest() if s.continuous else 0.0
            if fastest > 0:
                step = min(step, 2 * np.pi / fastest / 60)
    if experiment.blocks.solver.method == "euler":
        step /= 100
    if experiment.adaptive:
        return step
    return float(span / 2.0 ** np.clip(np.floor(np.log2(span / step)), 10, 20))


def first_moments(experiment: Experiment, step: float, apart: float) -> np.ndarray:
    """Times close behind the start, for observers whose gain is too fast for a step only then; none for most.

    The largest P(0) fades as P' = -2 P^2/(2 R) does, at the rate 2/(t + 2/rate): steps that are the same part of that
    all along lengthen by the same factor each, until they are as long as the others.

    Parameters
    ----------
    step : float
        The longest.
    apart : float
        None are closer to each other, or to the start.

    Returns
    -------
    ndarray
        Counted from where the gain begins to fade.
    """
    if experiment.given_step is not None:
        return np.zeros(0)
    rates = [rate_of(label, design.observer, design.form) for label, design in experiment.designs.items()]
    rate = max((rate for rate in rates if np.isfinite(rate)), default=0.0)
    if not rate * step > 4 * PART:  # as long as fixed steps may be chosen
        return np.zeros(0)
    growth, unit = 1 + PART / 2, 2 / rate
    count = int(np.ceil(np.log(step / (unit * (growth - 1))) / np.log(growth)))
    found = unit * (growth ** np.arange(1, count + 1) - 1)
    return np.asarray(found[np.diff(found, prepend=0.0) > apart])


def _slopes(plant: SymbolicPlant) -> ca.Function:
    """df/dx with the inputs in it, from (t, x, p)."""
    model = plant.model
    slopes = ca.jacobian(model.dynamics, model.x)
    inputs = plant.inputs
    if plant.controller is not None:
        inputs = _state_feedback(plant, plant.controller)
        if not plant.controller.held:  # what drives it follows its state
            slopes += ca.jacobian(model.dynamics, model.u) @ ca.jacobian(inputs, model.x)
    return ca.Function("A", [model.t, model.x, plant.everything], [ca.substitute(slopes, model.u, inputs)])


def _state_feedback(plant: SymbolicPlant, law: ControlLaw) -> ca.SX:
    """All inputs as a controller with the true state and no integrals gives them, in the model's t, x and numbers."""
    model, everything = plant.model, plant.everything
    own = law.truth(model.t, model.x, plant.inputs, everything)
    none = ca.SX.zeros(len(law.integral))
    driven, _ = law.law(model.t, model.x, plant.inputs, none, own, everything)
    found = ca.SX(plant.inputs)
    for i, place in enumerate(law.driven):
        found[place] = driven[i]
    return found
