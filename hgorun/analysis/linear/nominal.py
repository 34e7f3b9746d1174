"""Runs to linearise along: the configured one measured without fault, and the observer on integrator chains."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hgorun.analysis.chains import on_chains, outputs_of_chains
from hgorun.analysis.reasons import RECALLS, NoValue, why_no_flow
from hgorun.errors import ConfigError, HgorunError
from hgorun.observers.base import AnyObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import HighGain
from hgorun.result.result import Result
from hgorun.simulation.design.first_inputs import started
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.outcome.outcome import since_start
from hgorun.simulation.preparation.preparation import needs_given_steps
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.symbolic.forms import BlockForm, ChainForm, Form

_POINTS = 2_000, 20_000  # fewest and most output points of a nominal run
_JUMPING = (CorrectedObserver, SampledObserver)
_NO_CHAIN = "the observer does not take a chain of integrators"
_MEMORY = 40.0  # of 1/(slowest rate): a chain's Riccati equation has come to rest


def nominal(run: PreparedRun, label: str | None = None) -> Result:
    """The configured run with continuous, undelayed and noise-free outputs, its estimates right from the start.

    What the observers' gains are when nothing disturbs them: the trajectory along which small errors are
    looked at, the same for every sampling period, delay and noise. The plant keeps its disturbance. Observers
    that jump at samples or look back at their own past are left out.

    Parameters
    ----------
    run : PreparedRun
    label : str, optional
        Of the only observer that is left; by default all of them run together.

    Raises
    ------
    NoValue
    """
    experiment, plant = run.experiment, run.plant
    if all(isinstance(o, _JUMPING) for o in experiment.observers.values()):
        raise NoValue("all observers here jump at the samples")
    recalled = {b.label for b in run.observers if b.recalled}
    if recalled == set(experiment.observers):
        raise NoValue(RECALLS)
    if plant.block.discretise:
        raise NoValue("the plant is stepped at the samples")
    span = run.span
    changes: dict[str, Any] = {
        "time.output_step": span / float(np.clip(span / run.step, *_POINTS)),
        "measurement": None,
        "metrics": None,
    }
    initial = dict(zip(plant.model.states, map(float, plant.initial), strict=True))
    for name, observer in experiment.observers.items():
        if isinstance(observer, _JUMPING) or label not in (None, name) or name in recalled:
            changes[f"observers.{name}"] = None
            continue
        try:  # the true state, unless the observer cannot start there
            started(run.forms[name], plant.initial, plant, observer.canonical, run.recorded)
        except ValueError:
            continue
        changes[f"observers.{name}.initial"] = initial
    failure = "without noise, sampling and delay there is no run"
    return _simulated(lambda: experiment.varied(changes, name="nominal").informed_by(experiment), failure)[1]


def chain(run: PreparedRun, label: str) -> tuple[PreparedRun, Result]:
    """The observer on chains of integrators as long as the plant's, phi = 0, in the run's time unit.

    It is what the observer is built for; its limits depend on the gains alone.

    Returns
    -------
    (PreparedRun, Result)
        A run with this observer alone, long enough for a Riccati equation to have come to rest at the end.

    Raises
    ------
    NoValue
    """
    observer = run.experiment.observers[label]
    if isinstance(observer, _JUMPING):  # the chains' outputs are continuous, which it would not take
        raise NoValue(why_no_flow(observer))
    if next(b for b in run.observers if b.label == label).recalled:
        raise NoValue(RECALLS)
    lengths = chain_lengths(run.forms[label])
    if lengths is None:
        raise NoValue(_no_chains(run.forms[label]))
    names = [[f"x{i + 1}_{j + 1}" for j in range(k)] for i, k in enumerate(lengths)]
    rates = {state: following for one in names for state, following in zip(one, [*one[1:], "0"], strict=True)}
    states = [one[j] for j in range(max(lengths)) for one in names if j < len(one)]
    if isinstance(run.forms[label], ChainForm):
        states = [s for one in names for s in one]
    block = run.experiment.resolved()["observers"][label]
    for name in ("initial", "saturation", "clip_estimate", "coordinates", "map", "chains"):
        block.pop(name, None)
    outputs = outputs_of_chains(len(names))
    block |= on_chains(observer, run.plant.model.outputs).model_dump(include={"speed"}, exclude_none=True)
    slowest = observer.settling_rate if isinstance(observer, HighGain) else 1.0
    end = _MEMORY / slowest
    config = {
        "time": {"end": end, "output_step": end / 10},
        "plant": {
            "type": "inline",
            "states": states,
            "dynamics": {s: rates[s] for s in states},
            "output": {output: one[0] for output, one in zip(outputs, names, strict=True)},
            "initial": dict.fromkeys(states, 0.0),
        },
        "observers": {label: block},
        "solver": {"method": "rk4", "step": _step(run, observer)},
    }
    with _of_this_plant(run, label):
        return _simulated(lambda: Experiment(config, name="chain").informed_by(run.experiment), _NO_CHAIN)


@contextmanager
def _of_this_plant(run: PreparedRun, label: str) -> Iterator[None]:
    """Say of a key that names states or outputs of the plant that chains have no such ones."""
    try:
        yield
    except NoValue as error:
        key = getattr(error.__cause__, "key", None) or ""
        within = key.removeprefix(f"observers.{label}.")
        model = run.plant.model
        name = next((part for part in within.split(".") if part in (*model.states, *model.outputs)), None)
        if name is None:
            raise
        raise NoValue(f"{_NO_CHAIN}: `{within}` is about {name} of this plant") from error


def _no_chains(form: Form) -> str:
    """Why no chains of integrators can stand in the place of what an observer has of the plant."""
    if not isinstance(form, BlockForm):
        return (
            "the observer has no copy of the plant in chains or triangular blocks, whose place integrators could take"
        )
    sizes = " and ".join(map(str, np.bincount(form.block)))
    return f"blocks of different sizes, of {sizes} states, are not chains of integrators"


def _step(run: PreparedRun, observer: AnyObserver) -> float | str:
    """For the chain at rest: the run's own step for observers that need a given one."""
    return run.step if needs_given_steps(run.experiment, observer) else "auto"


def chain_lengths(form: Form) -> tuple[int, ...] | None:
    """How long the chain of every output is; None where the blocks do not make chains."""
    if isinstance(form, ChainForm):
        return form.chains
    if not isinstance(form, BlockForm):
        return None
    sizes = np.bincount(form.block)
    return (len(sizes),) * int(sizes[0]) if np.all(sizes == sizes[0]) else None


def _simulated(experiment: Callable[[], Experiment], failure: str) -> tuple[PreparedRun, Result]:
    """The run of an experiment; ``failure`` introduces the reason where there is none.

    What was changed or made up for it stands in no file: the reason has no place in one.
    """
    try:
        run = prepare(experiment())
        return run, since_start(run, simulate_prepared(run))
    except ConfigError as error:
        key = f"{error.key}: " if error.key else ""
        raise NoValue(f"{failure}: {key}{error.message}") from error
    except HgorunError as error:
        raise NoValue(f"{failure}: {error}") from error
