"""Runs to linearise along: the configured one measured without fault, and the observer on integrator chains."""

from __future__ import annotations

from typing import Any

import numpy as np

from hgorun.analysis.reasons import NoValue
from hgorun.errors import HgorunError
from hgorun.observers.base import SampledObserver
from hgorun.observers.capabilities import HighGain
from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import perform, prepare
from hgorun.symbolic.forms import BlockForm, ChainForm, Form

_POINTS = 2_000, 20_000  # fewest and most output points of a nominal run
_MEMORY = 40.0  # of 1/(slowest rate): a chain's Riccati equation has come to rest


def nominal(run: PreparedRun) -> Result:
    """The configured run with continuous, undelayed and noise-free outputs, its estimates right from the start.

    What the observers' gains are when nothing disturbs them: the trajectory along which small errors are
    looked at, the same for every sampling period, delay and noise. The plant keeps its disturbance. Observers
    that jump at samples are left out.

    Raises
    ------
    NoValue
    """
    config = run.experiment.resolved()
    kept = [label for label, o in run.experiment.observers.items() if not isinstance(o, SampledObserver)]
    if not kept:
        raise NoValue("every observer here jumps at the samples")
    if run.plant.block.discretise:
        raise NoValue("the plant is stepped at the samples")
    initial = dict(zip(run.plant.model.states, map(float, run.plant.initial), strict=True))
    config["observers"] = {label: config["observers"][label] for label in kept}
    for label, block in config["observers"].items():
        form = run.forms[label]
        try:  # the true state, unless the observer cannot start there
            form.start(
                run.plant.initial, run.plant.parameters, run.experiment.observers[label].coordinates != "original"
            )
        except ValueError:
            continue
        block["initial"] = initial
    span = run.time.end - run.time.start
    config["time"]["output_step"] = span / float(np.clip(span / run.step, *_POINTS))
    config["measurement"] = {}
    for name in ("metrics", "figures"):
        config.pop(name, None)
    return _simulated(config, "nominal", "without noise, sampling and delay there is no run")[1]


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
    lengths = chain_lengths(run.forms[label])
    if lengths is None:
        raise NoValue("blocks of different sizes are no chains of integrators")
    names = [[f"x{i + 1}_{j + 1}" for j in range(k)] for i, k in enumerate(lengths)]
    rates = {state: following for one in names for state, following in zip(one, [*one[1:], "0"], strict=True)}
    states = [one[j] for j in range(max(lengths)) for one in names if j < len(one)]
    if isinstance(run.forms[label], ChainForm):
        states = [s for one in names for s in one]
    block = run.experiment.resolved()["observers"][label]
    for name in ("initial", "saturation", "coordinates"):
        block.pop(name, None)
    observer = run.experiment.observers[label]
    slowest = observer.settling_rate if isinstance(observer, HighGain) else 1.0
    end = _MEMORY / slowest
    return _simulated(
        {
            "time": {"end": end, "output_step": end / 10},
            "plant": {
                "type": "inline",
                "states": states,
                "dynamics": {s: rates[s] for s in states},
                "output": {f"y{i + 1}": one[0] for i, one in enumerate(names)},
                "initial": dict.fromkeys(states, 0.0),
            },
            "observers": {label: block},
            "solver": {"method": "rk4", "step": "auto"},
        },
        "chain",
        "the observer does not take a chain of integrators",
    )


def chain_lengths(form: Form) -> tuple[int, ...] | None:
    """How long the chain of every output is; None where the blocks do not make chains."""
    if isinstance(form, ChainForm):
        return form.chains
    if not isinstance(form, BlockForm):
        return None
    sizes = np.bincount(form.block)
    return (len(sizes),) * int(sizes[0]) if np.all(sizes == sizes[0]) else None


def _simulated(config: dict[str, Any], name: str, failure: str) -> tuple[PreparedRun, Result]:
    """The run of a configuration; ``failure`` introduces the reason where there is none."""
    try:
        run = prepare(Experiment(config, name=name))
        return run, perform(run)
    except HgorunError as error:
        raise NoValue(f"{failure}: {error}") from error
