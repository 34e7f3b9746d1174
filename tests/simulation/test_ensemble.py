"""Members of an ensemble: each has the bits that it has alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

import hgorun
from hgorun.engine.loose import fits
from hgorun.engine.member_numbers import MemberNumbers
from hgorun.engine.methods import METHODS
from hgorun.simulation.passes.lanes import reduction_of
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared

CONFIG = """
time: {end: 3, output_step: 0.05}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -4*x1 + sin(w*t)*x2/2}
  parameters: {w: 2}
  output: x1
  initial: {x1: 1, x2: 0}
measurement:
  sampling: {period: 0.1}
  noise: [{type: gaussian, std: 0.1, hold: 0.02}]
observers:
  SHGO: {type: shgo, theta: 3}
  FHGO: {type: fhgo2, theta: 3, r: 2}
solver: {method: rk4, step: 0.01}
metrics: {average: 0.3}
"""


def runs(count: int, *, alike: bool) -> list[PreparedRun]:
    """Runs that differ in their seeds and gains, and unless functions of time are alike, in a frequency."""
    base = hgorun.Experiment(yaml.safe_load(CONFIG), name="test")
    fast = [2 if alike else 2 + 0.2 * k for k in range(count)]
    own = [
        {"seed": k, "observers.SHGO.theta": 2 + 0.1 * k, "plant.parameters.w": w, "solver.step": 0.01}
        for k, w in enumerate(fast)
    ]
    return [prepare(base.varied(changes)) for changes in own]


def members(of: list[PreparedRun]) -> MemberNumbers:
    """Their numbers side by side."""
    plans, starts = zip(*(plan_of(run, as_given(run)) for run in of), strict=True)
    return MemberNumbers(
        z0=np.hstack([start.z for start in starts]),
        p=np.hstack([start.p for start in starts]),
        gain=np.column_stack([plan.gain for plan in plans]),
        bias=np.column_stack([plan.bias for plan in plans]),
        holds=np.column_stack([plan.holds for plan in plans]),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("lanes", "threads"), [(1, 1), (2, 2), (4, 1), (8, 2), (16, 1), (32, 3)])
def test_members_have_the_bits_of_runs_alone(lanes: int, threads: int) -> None:
    of = runs(11, alike=threads == 1)
    plan, reduction = plan_of(of[0], as_given(of[0]))[0], reduction_of(of[0])
    ensemble = of[0].structure.ensemble("rk4", lanes)
    found = ensemble.run(plan, members(of), reduction, threads=threads)
    values = reduction.named(found.reduced)
    kept = ensemble.run(plan, members(of), rows=True, threads=threads)
    assert kept.rows is not None
    np.testing.assert_array_equal(kept.rows[0], kept.first)
    for k, run in enumerate(of):
        alone = simulate_prepared(run)
        for j, (label, one) in enumerate(alone.observers.items()):
            for name, own in one.metrics.items():
                np.testing.assert_array_equal(values[name][j, :, k], own, err_msg=f"{name} of {label}, member {k}")
        np.testing.assert_array_equal(kept.rows[:, :2, k], alone.x)
        np.testing.assert_array_equal(found.last[:2, k], alone.x[-1])


def test_metrics_that_numpy_makes_of_rows_are_those_that_are_made_beside_the_run() -> None:
    """As of metrics that are not compiled, a part of the members at a time."""
    of, told = runs(5, alike=True), list[int]()
    plan, reduction = plan_of(of[0], as_given(of[0]))[0], reduction_of(of[0])
    ensemble = of[0].structure.ensemble("rk4", 2)
    compiled = ensemble.run(plan, members(of), reduction)
    plain = ensemble.run(plan, members(of), replace(reduction, places=None), progress=told.append)
    np.testing.assert_allclose(plain.reduced, compiled.reduced, rtol=1e-12)
    np.testing.assert_array_equal(plain.last, compiled.last)
    assert plain.rows is None
    assert told[-1] == 5


@pytest.mark.slow
def test_every_member_has_its_own_continuous_delay() -> None:
    """Delays are parameters, and may differ in runs that land on the same events."""
    config = yaml.safe_load(CONFIG) | {"measurement": {"delay": "0.1 + 0.05*abs(cos(3*t))"}}
    base = hgorun.Experiment(config, name="test")
    of = [prepare(base.varied({"measurement.delay": f"{0.1 + 0.01 * k} + 0.05*abs(cos(3*t))"})) for k in range(9)]
    plans, starts = zip(*(plan_of(run, as_given(run)) for run in of), strict=True)
    plan = replace(plans[0], reach=max(plan.reach for plan in plans))
    together = of[0].structure.ensemble("rk4").run(plan, members(of), rows=True)
    assert together.rows is not None
    for k, (run, start) in enumerate(zip(of, starts, strict=True)):
        alone = run.structure.program("rk4").run(plan, start).rows[..., 0]
        np.testing.assert_array_equal(together.rows[..., k], alone)
    assert not np.array_equal(together.rows[..., 0], together.rows[..., 1])


@pytest.mark.costly
@pytest.mark.parametrize("stride", [1, 2, 3])
def test_numbers_of_any_strides(stride: int) -> None:
    """The last members of a block that is not full may lie as far apart as a full one is wide."""
    of = runs(6, alike=False)
    plan, numbers = plan_of(of[0], as_given(of[0]))[0], members(of)

    def apart(array: np.ndarray) -> np.ndarray:
        wide = np.full((len(array), stride * 6), np.nan)
        wide[:, ::stride] = array
        return wide[:, ::stride]

    names = ("z0", "p", "gain", "bias", "holds")
    z0, p, gain, bias, holds = (apart(getattr(numbers, name)) for name in names)
    ensemble = of[0].structure.ensemble("rk4", lanes=4)
    straight = ensemble.run(plan, numbers, rows=True).rows
    found = ensemble.run(plan, MemberNumbers(z0=z0, p=p, gain=gain, bias=bias, holds=holds), rows=True).rows
    assert found is not None
    np.testing.assert_array_equal(found, straight)


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize(
    "changed",
    [
        {"sampling": {"period": 0.1, "jitter": 0.03}},
        {"sampling": {"period": 0.1, "dropout": 0.3}},
        {"sampling": {"period": 0.1, "jitter": 0.03, "dropout": 0.2}, "delay": "0.15*abs(cos(3*t))"},
    ],
)
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_members_with_their_own_events_have_the_bits_of_runs_alone(changed: dict[str, object], method: str) -> None:
    config = yaml.safe_load(CONFIG)
    config["measurement"] |= changed
    config["solver"]["method"] = method
    config["plant"]["dynamics"]["x2"] += " + floor(2*t)/5"  # another value on each side of an event
    base = hgorun.Experiment(config, name="test")
    of = [prepare(base.varied({"seed": k})) for k in range(24)]
    of = [run for run in of if run.structure is of[0].structure]
    assert len(of) > 8
    plans, starts = zip(*(plan_of(run, as_given(run)) for run in of), strict=True)
    numbers = MemberNumbers(
        z0=np.hstack([start.z for start in starts]),
        p=np.hstack([start.p for start in starts]),
        gain=plans[0].gain,
        bias=plans[0].bias,
        holds=plans[0].holds,
    )
    assert len({plan.spans.tobytes() for plan in plans}) > 1
    assert np.any(plans[0].spans[:, 2] != plans[0].spans[:, 0])
    assert fits(of[0].structure.system, METHODS[method])
    reduction, ensemble = reduction_of(of[0]), of[0].structure.ensemble(method)
    found, kept = ensemble.run_each(plans, numbers, reduction), ensemble.run_each(plans, numbers, rows=True)
    values = reduction.named(found.reduced)
    assert kept.rows is not None
    for k, (run, plan, start) in enumerate(zip(of, plans, starts, strict=True)):
        alone = run.structure.program(method).run(plan, start)
        np.testing.assert_array_equal(kept.rows[..., k], alone.rows[..., 0])
        np.testing.assert_array_equal(found.last[:, k], alone.rows[-1, :, 0])
        np.testing.assert_array_equal(found.diverged[:, k], alone.diverged[:, 0])
        metrics = simulate_prepared(run).observers["FHGO"].metrics
        for name, own in metrics.items():
            np.testing.assert_array_equal(values[name][1, :, k], own, err_msg=name)
