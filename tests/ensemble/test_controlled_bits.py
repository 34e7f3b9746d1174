"""Members with controlled steps, and those of the stiff method, have side by side the bits that they have alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment, inline
from test_bits import AXES, COUNT, MEASURED, alone, van_der_pol

from hgorun.ensemble.blocks.block import Block, _Work, compute
from hgorun.ensemble.members.members import Members
from hgorun.result.records.status import STATUSES
from hgorun.simulation.experiment.experiment import Experiment

TOLERANCES = {"method": "dopri5", "rtol": 1e-6}
STIFF = {"method": "rodas5p", "rtol": 1e-6, "atol": 1e-9}
FIXED = {"method": "rodas5p", "step": 0.02}


@pytest.fixture
def singles(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Which members are carried out one by one."""
    found: list[int] = []
    one = _Work._one

    def noted(self: _Work, i: int, run: Any) -> None:
        found.append(i)
        one(self, i, run)

    monkeypatch.setattr(_Work, "_one", noted)
    return found


def compared(base: Experiment, members: Members, every: int = 5) -> Block:
    block = compute(base, members)
    for i in range(0, len(members), every):
        alone(base, members, i, block)
    return block


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solver", "measured", "axes"),
    [
        (TOLERANCES, "multiplicative", "lost and refused"),
        (TOLERANCES, "jitter", "seed"),
        (STIFF, "sampled", "initial"),
        (FIXED, "jitter", "theta"),
    ],
    ids=["dopri5", "jitter", "rodas5p", "fixed"],
)
def test_van_der_pol(solver: dict[str, Any], measured: str, axes: str, singles: list[int]) -> None:
    block = compared(van_der_pol(MEASURED[measured], 0.01).varied({"solver": solver}), Members.of(AXES[axes]))
    assert "ok" in {STATUSES[status] for status in np.unique(block.status)}
    assert not singles


@pytest.mark.measured
@pytest.mark.slow
def test_members_that_fail_do_not_disturb_the_others(singles: list[int]) -> None:
    """Plants that are infinite after a while, and estimates that are lost."""
    base = experiment(
        inline({"x1": "x2", "x2": "-x1 + a*x2**3"}, "x1", parameters={"a": 1.0}),
        {"S": {"type": "shgo", "theta": 5}},
        end=2.0,
        step=None,
        measurement={"sampling": {"period": 0.05}, "noise": [{"type": "gaussian", "std": 0.02}]},
    ).varied({"solver": TOLERANCES})
    x2 = np.random.default_rng(3).uniform(0.2, 1.5, COUNT)
    block = compared(base, Members.of({"plant.initial.x2": x2, "seed": np.arange(COUNT)}), 3)
    failed = np.flatnonzero(block.plant_status == STATUSES.index("failed"))
    assert 0 < failed.size < COUNT
    assert sorted(singles) == failed.tolist()  # for the sentence that says why


def test_threads_do_not_matter() -> None:
    base = van_der_pol(MEASURED["sampled"], 0.01).varied({"solver": TOLERANCES})
    members = Members.of({"seed": np.arange(40), "observers.S.theta": np.linspace(1, 5, 40)})
    one, two = compute(base, members), compute(base, members, threads=2)
    assert all(one.metrics[name].tobytes() == two.metrics[name].tobytes() for name in one.metrics)
    assert np.array_equal(one.evaluations, two.evaluations)
    assert np.all(one.rtol == 1e-6)
    assert np.all(np.isnan(one.step))


@pytest.mark.one_in(3)
@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("measured", MEASURED)
@pytest.mark.parametrize("solver", [TOLERANCES, STIFF, FIXED], ids=["dopri5", "rodas5p", "fixed"])
def test_all_kinds(solver: dict[str, Any], measured: str, axes: str) -> None:
    compared(van_der_pol(MEASURED[measured], 0.01).varied({"solver": solver}), Members.of(AXES[axes]), 7)


@pytest.mark.costly
def test_a_plant_of_which_the_steps_differ_by_far() -> None:
    """Relaxation oscillations from different phases: a lane makes many steps where another makes one."""
    base = experiment(
        VAN_DER_POL | {"parameters": {"mu": 50}}, {"S": {"type": "shgo", "theta": 3}}, end=2.0, step=None
    ).varied({"solver": STIFF})
    x1, x2 = np.linspace(-2, 2, COUNT), np.linspace(3, -3, COUNT)
    members = Members.of({"plant.initial.x1": x1, "plant.initial.x2": x2})
    block = compared(base, members, 7)
    assert np.ptp(block.evaluations) > 0.2 * np.max(block.evaluations)


SPECIAL: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {  # plant, solver, observer
    "explicit": (VAN_DER_POL, {"method": "dopri5", "accuracy": 1e-6}, {"theta": 3}),
    "stiff": (VAN_DER_POL | {"parameters": {"mu": 30}}, {"method": "rodas5p"}, {"theta": 3}),
    "fast": (VAN_DER_POL, {}, {"theta": 6e4}),
}


@pytest.mark.parametrize("kind", SPECIAL)
def test_automatic_steps_that_errors_control(kind: str, singles: list[int]) -> None:
    """Methods with an error estimate, and runs for which fixed steps would be too many."""
    plant, solver, observer = SPECIAL[kind]
    base = experiment(plant, {"S": {"type": "shgo", **observer}}, end=2.0, step=None).varied({"solver": solver})
    members = Members.of({"plant.initial.x1": np.linspace(0.5, 2, COUNT)})
    block = compared(base, members, 6)
    assert np.all(np.isfinite(block.rtol))
    assert np.all(np.isfinite(block.integration_error))
    assert len(singles) <= 2
