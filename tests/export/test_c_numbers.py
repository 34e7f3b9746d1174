"""Exported C gives hgorun's numbers: every family of the registry, driven by the samples of a simulated run."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from examples import Block
from exported_c import Compiled, driven, follow, load_all

from hgorun import Experiment
from hgorun.errors import ConfigError
from hgorun.export.names import identifier
from hgorun.export.operations import operations
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


def test_powers_of_one_base_share_its_logarithm() -> None:
    """Of exponents that are fractions of a usual size; roots and others stay the library's ``pow``."""
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p"), ca.SX.sym("z"), ca.SX.sym("w")
    powers = ca.vertcat(z**0.9, z**-1.1, z**p, z**1.5, z**2.5, z**3.3, z**w)
    found = operations(ca.Function("f", [t, p, z, w], [powers], ["t", "p", "z", "w"], ["powers"]), np.array([0.3]))
    count = Counter(found.steps[k].op for k in found.needed("powers"))
    assert (count[ca.OP_LOG], count[ca.OP_EXP], count[ca.OP_POW] + count[ca.OP_CONSTPOW]) == (1, 3, 4)


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
