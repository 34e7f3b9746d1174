"""Every member of an ensemble has the bits that it has alone, whatever the others are and however it is carried out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment, inline, sinusoid
from pydantic import Field

from hgorun import Experiment, HgorunError, Result, simulate
from hgorun.config.types import Positive
from hgorun.ensemble.blocks.block import Block, compute
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation.axes import Axes
from hgorun.noise.base import NOISE, RandomNoise
from hgorun.result.records.data import PLANT
from hgorun.result.records.status import STATUSES

COUNT = 30  # enough for members to be taken in bulk
RANDOM = np.random.default_rng(5)
GAUSSIAN = {"type": "gaussian", "std": 0.1}
HELD = GAUSSIAN | {"hold": 0.05}
MEASURED: dict[str, dict[str, Any]] = {
    "sampled": {"sampling": {"period": 0.1}, "noise": [GAUSSIAN]},
    "held": {"noise": [HELD]},
    "multiplicative": {
        "sampling": {"period": 0.1},
        "noise": [GAUSSIAN, {"type": "uniform", "low": -0.1, "high": 0.2}, *sinusoid(0.1, 3.0)],
        "mode": "multiplicative",
    },
    "jitter": {"sampling": {"period": 0.1, "jitter": 0.02, "dropout": 0.1}, "noise": [GAUSSIAN]},
    "late": {"delay": 0.1, "noise": [HELD]},
    "phases": {
        "noise": [HELD],
        "phases": [{"until": 1.0, "sampling": {"period": 0.1}}, {"until": 2.0, "delay": 0.05}],
    },
}
AXES: dict[str, dict[str, Any]] = {
    "seed": {"seed": RANDOM.integers(0, 2**62, COUNT)},
    "theta": {"observers.*.theta": RANDOM.uniform(1, 6, COUNT)},
    "lost and refused": {
        "observers.S.theta": RANDOM.choice([2.0, 3.0, 200.0, -1.0], COUNT),
        "observers.F.initial.x1": RANDOM.normal(0, 1, COUNT),
        "seed": np.arange(COUNT),
    },
    "initial": {
        "plant.initial.x1": RANDOM.normal(0, 1, COUNT),
        "plant.initial.x2": RANDOM.choice([0.0, 0.5, 1.0], COUNT),
    },
    "parameter": {"plant.parameters.mu": RANDOM.uniform(0.5, 1.5, COUNT)},
    "size of noise": {"measurement.noise.0.std": RANDOM.choice([0.0, 0.1, 0.5, -1.0], COUNT), "seed": np.arange(COUNT)},
    "span": {"time.end": RANDOM.choice([1.5, 2.0], COUNT), "observers.S.poles": [-1.0, [-1.0, -2.0]] * (COUNT // 2)},
}


def van_der_pol(measurement: Mapping[str, Any], step: float | None) -> Experiment:
    return experiment(
        VAN_DER_POL,
        {"S": {"type": "shgo", "theta": 3}, "F": {"type": "fhgo1", "theta": 2, "delta": 3}},
        end=2.0,
        step=step,
        measurement=dict(measurement),
    )


def carried_out(base: Experiment, changes: Mapping[str, Any]) -> tuple[Result | None, str]:
    try:
        return simulate(base.varied(changes)), ""
    except HgorunError as error:
        return None, str(error)


def alone(base: Experiment, members: Members, i: int, block: Block) -> None:
    """Member i has the numbers, the status and the message of the member alone."""
    one, message = carried_out(base, members.of_observers(base).changes(i))
    assert block.error[i] == message
    if one is None:
        assert np.all(block.status[i] == STATUSES.index("failed"))
        return
    for j, label in enumerate(block.observers):
        own = one.observers[label]
        for name, values in block.metrics.items():
            assert values[i, j].tobytes() == np.asarray(own.metrics[name], dtype=float).tobytes(), (i, label, name)
        assert (STATUSES[block.status[i, j]], block.reason[i, j]) == (own.status, own.reason or "")
        for found, at in ((block.status_at, own.status_at), (block.diverged_at, own.diverged_at)):
            assert np.array_equal(found[i, j], np.nan if at is None else at, equal_nan=True)
    how = one.integration
    assert how is not None
    assert (block.method[i], block.evaluations[i]) == (how.method, how.evaluations)
    assert np.array_equal(block.step[i], np.nan if how.step is None else how.step, equal_nan=True)
    if not callable(how.error):
        errors = [how.error.relative.get(label, np.nan) for label in (PLANT, *block.observers)]
        assert np.array_equal(block.integration_error[i], errors, equal_nan=True)


@pytest.mark.measured("multiplicative-span", "jitter-size of noise")
@pytest.mark.slow
@pytest.mark.one_in(3)
@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("measured", MEASURED)
def test_given_steps(measured: str, axes: str) -> None:
    base, members = van_der_pol(MEASURED[measured], 0.01), Members.of(AXES[axes])
    block = compute(base, members)
    for i in range(0, COUNT, 4):
        alone(base, members, i, block)


@pytest.mark.measured("multiplicative-parameter")
@pytest.mark.slow
@pytest.mark.parametrize("axes", ["seed", "theta", "lost and refused", "parameter"])
@pytest.mark.parametrize("measured", ["held", "multiplicative"])
def test_automatic_steps(measured: str, axes: str) -> None:
    base, members = van_der_pol(MEASURED[measured], None), Members.of(AXES[axes])
    block = compute(base, members)
    for i in range(0, COUNT, 4):
        alone(base, members, i, block)


@pytest.mark.slow
@pytest.mark.parametrize("root", [False, True])
@pytest.mark.parametrize("step", [0.01, None])
def test_members_whose_plant_or_estimate_is_lost(step: float | None, root: bool) -> None:
    """Plants that diverge or are undefined, estimates that leave, and those that come back."""
    rate = "-sqrt(x1 + 0.5) - x2" if root else "-x1 + a*x2**3"
    base = experiment(
        inline({"x1": "x2", "x2": rate}, "x1", parameters={} if root else {"a": 1.0}),
        {"S": {"type": "shgo", "theta": 5}},
        end=2.0,
        step=step,
        measurement={"sampling": {"period": 0.05}, "noise": [{"type": "gaussian", "std": 0.02}]},
    )
    random = np.random.default_rng(3)
    members = Members.of({"plant.initial.x2": random.uniform(0.2, 1.5, COUNT), "seed": np.arange(COUNT)})
    if root:
        members = Members.of({"plant.initial.x1": np.linspace(-0.6, 1.5, COUNT), "seed": np.arange(COUNT)})
    block = compute(base, members)
    assert {"failed", "ok"} <= {STATUSES[status] for status in np.unique(block.status)}
    for i in range(0, COUNT, 3):
        alone(base, members, i, block)


@pytest.mark.measured("one state", "no observer", "output function", "two outputs")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "observers", "more"),
    [
        (inline({"x1": "-x1 + sin(t)"}, "x1"), {"S": {"type": "shgo", "theta": 5}}, {"measurement": {"noise": [HELD]}}),
        (inline({"x1": "-x1 + sin(t)"}, "x1"), {}, {"step": 0.01}),
        (
            inline({"x1": "x2", "x2": "-x1"}, "x1 + 0.1*x1**3"),
            {"S": {"type": "shgo", "theta": 3}},
            {"step": 0.01, "measurement": {"sampling": {"period": 0.1}, "noise": [GAUSSIAN]}},
        ),
        (
            inline({"x1": "x2", "x2": "-x1", "x3": "x1 - x3"}, ["x1", "x3"]),
            {"S": {"type": "shgo", "theta": 3}},
            {
                "step": 0.01,
                "measurement": {
                    "sampling": {"period": 0.1},
                    "noise": [GAUSSIAN],
                    "outputs": {"x3": {"noise": [GAUSSIAN | {"std": 0.3}]}},
                },
            },
        ),
        (
            VAN_DER_POL,
            {"S": {"type": "shgo", "theta": 3}},
            {
                "solver": {"step": 0.01, "method": "euler", "divergence": 3},
                "measurement": {"noise": [HELD | {"std": 1}]},
            },
        ),
        (
            VAN_DER_POL,
            {"S": {"type": "shgo", "theta": 3}},
            {"solver": {"rtol": 1e-6, "method": "dopri5"}, "measurement": {"noise": [HELD]}},
        ),
    ],
    ids=["one state", "no observer", "output function", "two outputs", "bound", "tolerances"],
)
def test_kinds_of_runs(plant: dict[str, Any], observers: dict[str, Any], more: dict[str, Any]) -> None:
    base = experiment(plant, observers, **{"end": 1.5, **more})
    members = Members.of({"seed": np.arange(COUNT), "plant.initial.x1": np.linspace(0.3, 0.9, COUNT)})
    block = compute(base, members)
    for i in range(0, COUNT, 5):
        alone(base, members, i, block)


@pytest.mark.measured
@pytest.mark.slow
def test_what_is_narrow_in_a_state() -> None:
    """A force within a thousandth of a position, which some of the members pass."""
    plant = inline({"x1": "x2", "x2": "-x1 + 200*exp(-((x1 - 1)/1e-3)**2)"}, "x1", initial={"x1": 0.0, "x2": 0.0})
    base = experiment(plant, {"S": {"type": "shgo", "theta": 3}}, end=2.0)
    members = Members.of({"plant.initial.x1": np.linspace(0.3, 1.5, COUNT)})
    block = compute(base, members)
    for i in (0, 12, 29):
        alone(base, members, i, block)


@pytest.mark.slow
def test_two_hundred_members_at_random() -> None:
    base = van_der_pol(MEASURED["sampled"], 0.02)
    random = np.random.default_rng(0)
    members = Members.of(
        {
            "observers.*.theta": random.uniform(0.5, 8, 2000),
            "plant.initial.x1": random.normal(0, 2, 2000),
            "seed": random.integers(0, 2**40, 2000),
        }
    )
    block = compute(base, members)
    assert np.count_nonzero(block.status == 0) > 3000
    for i in random.choice(2000, 200, replace=False).tolist():
        alone(base, members, i, block)


@pytest.mark.costly
def test_the_order_of_members_does_not_matter() -> None:
    base = van_der_pol(MEASURED["sampled"], 0.02)
    members = Members.of({"observers.S.theta": np.linspace(1, 60, 50), "seed": np.arange(50)})
    order = np.random.default_rng(1).permutation(50)
    straight, mixed = compute(base, members), compute(base, members[order])
    few = compute(base, members[7:9])
    for name, values in straight.metrics.items():
        assert values[order].tobytes() == mixed.metrics[name].tobytes()
        assert values[7:9].tobytes() == few.metrics[name].tobytes()
    assert np.array_equal(straight.status[order], mixed.status)
    assert list(straight.reason[order].ravel()) == list(mixed.reason.ravel())


def test_threads_do_not_matter() -> None:
    base = van_der_pol(MEASURED["jitter"], 0.02)
    members = Members.of({"observers.S.theta": np.linspace(1, 90, 30), "seed": np.arange(30)})
    one, two = compute(base, members), compute(base, members, threads=2)
    assert all(one.metrics[name].tobytes() == two.metrics[name].tobytes() for name in one.metrics)
    assert np.array_equal(one.status, two.status)


def test_what_is_finished_is_told() -> None:
    told: list[int] = []
    members = Members.of({"observers.S.theta": np.linspace(-1, 5, 40)})
    compute(van_der_pol(MEASURED["sampled"], 0.02), members, progress=told.append)
    assert told[-1] == 40
    assert told == sorted(told)


class Laplace(RandomNoise):
    """A kind of another package, whose draws a key multiplies."""

    b: Positive = Field(description="scale")
    scaled_by: ClassVar[str | None] = "b"

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return random.laplace(size=count) * self.b


def test_a_kind_of_noise_declares_what_multiplies_its_draws() -> None:
    with NOISE.replaced("laplace", Laplace):
        base = van_der_pol({"sampling": {"period": 0.1}, "noise": [{"type": "laplace", "b": 0.1}]}, 0.01)
        sizes = RANDOM.choice([0.01, 0.1, 0.5, -1.0], COUNT)
        members = Members.of({"measurement.noise.0.b": sizes, "seed": np.arange(COUNT)})
        assert Axes.of(base, members).deviations == {"measurement.noise.0.b": ((0, 0, 0),)}
        block = compute(base, members)
        for i in range(0, COUNT, 3):
            alone(base, members, i, block)
    assert "failed" in {STATUSES[status] for status in np.unique(block.status)}
