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
    again = {name for name, run in runs.items() if counts_again(run, compiled[identifier(name)])}
    assert again == {"ekf", "impulsive_riccati", "spline", "ukf"}  # as by repeated: keep


def counts_again(run: PreparedRun, one: Compiled) -> bool:
    """Whether samples that are sent a second time change the estimate; nothing else may come of them."""
    once, twice = (Compiled(one.library, one.observer) for _ in range(2))
    found, q = driven(run), len(one.observer.outputs)
    for t, samples in zip(found.events, found.samples, strict=True):
        assert once.predict(t) == twice.predict(t) == 0
        values = {i: y for i, _, y, _ in samples}
        y, which = [values.get(i, 0.0) for i in range(q)], sum(1 << i for i in values)
        if values:
            assert once.update(t, y, which) == twice.update(t, y, which) == 0
            before, status = twice.memory.raw, twice.update(t, y, which)
            assert status == 0 or (status == 1 and twice.memory.raw == before)
    assert np.isfinite(twice.estimate).all()
    return not np.allclose(once.estimate, twice.estimate, rtol=1e-9, atol=1e-9)


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
