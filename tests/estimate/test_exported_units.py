"""Units for other simulators give the numbers of ``hgorun estimate``: all families that are exported, FMI 2 and 3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from examples import Block
from exported_fmu import GCC, Unit
from recordings import of_simulation, source

from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.export.fmu import fmu
from hgorun.export.fmu_templates import VERSIONS, Version
from hgorun.export.prepared import exported_estimate
from hgorun.observers.base import OBSERVERS
from hgorun.simulation.simulate import prepare
from hgorun.testing.cases import Subject

PERIOD, COUNT = 0.1, 20
REFUSED = {"aekf", "bank", "kkl", "mhe", "predictor_chain", "switched"}
EXPORTED = sorted(set(OBSERVERS.names()) - REFUSED)


def estimated(name: str, **keys: object) -> tuple[PreparedEstimate, np.ndarray]:
    """A log of samples of the first common plant, and what is estimated half a period after each of them."""
    case = Subject(OBSERVERS.find(name), name, {}, None).cases[0]
    sampled: Block = {"sampling": {"period": PERIOD, "offset": PERIOD}, "noise": [{"type": "gaussian", "std": 0.02}]}
    run = prepare(
        case.experiment({name: {"initial": case.aside, **keys}}, measurement=sampled, end=PERIOD * (COUNT + 1))
    )
    recording = of_simulation(run)
    text: Block = {
        "time": {"start": 0.0, "end": PERIOD * (COUNT + 1), "output_step": PERIOD / 2},
        "plant": dict(case.plant_keys),
        "observers": {name: {"type": name, **case.keys, "initial": case.aside, **keys}},
        "measurement": sampled,
        "solver": {"step": PERIOD / 20},
    }
    prepared = prepare_estimate(completed(source(text), recording, "log", ""), recording)
    found = estimate(source(text), recording, sensitivity=False)
    rows = np.searchsorted(found.time, PERIOD * (1.25 + np.arange(COUNT)))
    np.testing.assert_allclose(found.time[rows], PERIOD * (1.5 + np.arange(COUNT)), rtol=0, atol=1e-9)
    return prepared, found.observers[name].xhat[rows]


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", EXPORTED)
def test_numbers(name: str, version: Version, tmp_path: Path) -> None:
    prepared, expected = estimated(name)
    file = tmp_path / "O.fmu"
    file.write_bytes(fmu(exported_estimate(prepared)[0], version, GCC[:1]))
    unit, half = Unit(file, version), PERIOD / 2
    xhat = [number for variable, number in unit.number.items() if variable.startswith("xhat")]
    outputs, found = [one.output for one in prepared.samples], []
    values = {one.output: one.values for one in prepared.samples}
    for k in range(COUNT + 1):
        for name_ in outputs:
            unit.tell(**{f"new_{name_}": float(k > 0)} | ({f"y_{name_}": values[name_][k - 1]} if k else {}))
        unit.unit.doStep(5.0 + PERIOD * k, half)
        found.append(unit.get(xhat))
        unit.tell(**{f"new_{name_}": 0.0 for name_ in outputs})
        unit.unit.doStep(5.0 + PERIOD * k + half, half)
    assert np.ptp(expected, axis=0).max() > 0.02
    np.testing.assert_allclose(found[1:], expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


@pytest.mark.parametrize(
    ("name", "instead"),
    [("bank", "; take the observer of one mode"), ("aekf", "; with update: jump, for sampled ")],
)
def test_what_decides_is_refused_with_what_does_not(name: str, instead: str) -> None:
    prepared, _ = estimated(name)
    with pytest.raises(ConfigError, match=f"there is no place in it for decisions{instead}"):
        exported_estimate(prepared)


def test_what_the_message_advises_is_exported() -> None:
    prepared, _ = estimated("aekf", update="jump", copies=2)
    assert len(exported_estimate(prepared)) == 1
