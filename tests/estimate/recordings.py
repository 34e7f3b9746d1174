"""Recordings that tests of estimates are made of."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from examples import Block, experiment, inline

from hgorun.config.yaml_source import Source, parse
from hgorun.data.recording import InputSignal, Origin, Recording, Signal
from hgorun.result.records.recorded import Assessed, Recorded
from hgorun.result.result import Result
from hgorun.simulation.passes.passes import as_given, integrate
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

PENDULUM = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a")
POLES: Block = {"theta": 2, "poles": -1}
NOISE = [{"type": "gaussian", "std": 0.05}]
START = {"a": 0.0, "b": 1.0}


def signal(name: str, taken: Any, values: Any, available: Any = None, **more: Any) -> Signal:
    """Samples of one quantity."""
    t = np.asarray(taken, dtype=float)
    known = t if available is None else np.asarray(available, dtype=float)
    return Signal(
        name=name,
        unit="",
        taken=t,
        available=known,
        values=np.asarray(values, dtype=float),
        lines=np.arange(2, t.size + 2),
        source=Path("log.csv"),
        column=name,
        **more,
    )


def held_input(name: str, times: Any, values: Any, hold: Any = "zero") -> InputSignal:
    """A recorded input."""
    t = np.asarray(times, dtype=float)
    return InputSignal(
        name=name,
        unit="",
        times=t,
        values=np.asarray(values, dtype=float),
        hold=hold,
        lines=np.arange(2, t.size + 2),
        source=Path("log.csv"),
    )


def recording(*outputs: Signal, reference: Mapping[str, Signal] | None = None, **inputs: InputSignal) -> Recording:
    """What was recorded of some outputs and inputs."""
    return Recording(
        outputs={one.name: one for one in outputs}, inputs=inputs, reference=reference or {}, origin=Origin(unit="s")
    )


def of_simulation(run: PreparedRun) -> Recording:
    """What a simulated run has measured."""
    raw = integrate(run, as_given(run))
    counts = np.cumsum([c.samples.arrival.size for c in run.channels])
    values = np.split(raw.measured[:, 0], counts)
    found = []
    for c, y in zip(run.channels, values, strict=False):
        s = c.samples
        found.append(signal(c.name, run.origin + s.taken, y, None if s.taken is s.arrival else run.origin + s.arrival))
    return recording(*found)


def pendulum(observers: Mapping[str, Block], **more: Any) -> PreparedRun:
    """A simulated pendulum, one angle of it sampled with noise."""
    return prepare(experiment(PENDULUM, observers, **{"end": 6.0, "step": 0.01, **more}))


def source(config: Mapping[str, Any]) -> Source:
    """A configuration as from a file."""
    return parse(yaml.safe_dump(dict(config), sort_keys=False), "estimate.yaml")


def observers(*types: str, **more: Any) -> dict[str, Block]:
    """Blocks of some types, with gains that suit the pendulum."""
    return {name: {"type": name, **POLES, "initial": START, **more} for name in types}


def recorded_of(result: Result) -> Recorded:
    """What an estimate was made of."""
    assert result.recorded is not None
    return result.recorded


def assessed_of(result: Result, label: str) -> Assessed:
    """What is said of an observer."""
    assessed = result.observers[label].assessed
    assert assessed is not None
    return assessed
