"""Exported C gives hgorun's numbers: every family of the registry, driven by the samples of a simulated run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from examples import Block
from exported_c import Compiled, driven, follow, load_all

from hgorun import Experiment
from hgorun.errors import ConfigError
from hgorun.export.names import identifier
from hgorun.export.prepared import exported
from hgorun.observers.base import OBSERVERS, SampledObserver
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare
from hgorun.testing.cases import Subject

REFUSED = {
    "aekf",
    "bank",
    "kkl",
    "mhe",
    "predictor_chain",
    "switched",
}  # no formula of the samples, or decisions between
NOISE = [{"type": "gaussian", "std": 0.02}]


def run_of(name: str) -> PreparedRun:
    """An observer of a family on the first common plant that it takes, on samples that are irregular."""
    cls = OBSERVERS.find(name)
    case = Subject(cls, name, {}, None).cases[0]
    measurement: Block = {"sampling": {"period": 0.1, "jitter": 0.02}, "noise": NOISE}
    if issubclass(cls, SampledObserver) or name in ("luenberger_exact", "kkl"):  # whose gains are for one period
        measurement = {"sampling": {"period": 0.1}, "noise": NOISE}
    experiment: Experiment = case.experiment({name: {"initial": case.aside}}, measurement=measurement, end=3.0)
    return prepare(experiment)


@pytest.mark.slow
def test_every_family(tmp_path: Path) -> None:
    runs = {name: run_of(name) for name in OBSERVERS.names()}
    assert {name for name, run in runs.items() if not is_exported(run)} <= REFUSED
    runs = {name: run for name, run in runs.items() if is_exported(run)}
    observers = [exported(run)[0] for run in runs.values()]
    compiled = load_all(tmp_path, observers, "-O1", "-march=native")
    worst = {name: difference(run, compiled[identifier(name)], name) for name, run in runs.items()}
    assert max(worst.values()) <= 1e-12, worst


def is_exported(run: PreparedRun) -> bool:
    """Whether the observer can be exported."""
    try:
        return bool(exported(run))
    except ConfigError:
        return False


def difference(run: PreparedRun, observer: Compiled, label: str) -> float:
    """The largest difference to the engine's estimates, relative to the largest estimate."""
    found = driven(run)
    own = np.array(list(follow(run, found, observer)))
    theirs = found.estimates[label]
    assert np.ptp(theirs, axis=0).max() > 0.05
    return float(np.max(np.abs(own - theirs)) / np.max(np.abs(theirs)))
