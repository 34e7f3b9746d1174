"""Members of closed loops have the bits that they have alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from examples import experiment, inline

from hgorun import Experiment
from hgorun.config.tuning import Tune
from hgorun.ensemble.blocks.block import Block, compute
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.side_by_side.lanes import fits
from hgorun.errors import Problem
from hgorun.simulation.simulate import prepare, simulate
from hgorun.tuning.task import tasks
from hgorun.tuning.trials import measured

COUNT = 26  # enough for members to be taken in bulk
RANDOM = np.random.default_rng(3)
GAUSSIAN = {"type": "gaussian", "std": 0.05}
CONTROLLER: dict[str, Any] = {
    "law": {"u": "-k*x1 - 2*x2 - xi"},
    "saturation": {"u": [-1.5, 1.5]},
    "integral": {"xi": "x1"},
    "period": 0.1,
    "cost": {"x1": 1, "u": 0.1},
}


def loops(step: float | None, measurement: Mapping[str, Any]) -> Experiment:
    plant = inline({"x1": "x2", "x2": "x2**3 - x1 + u"}, "x1", inputs={"u": "controller"}, parameters={"k": 1})
    box = {"x2": [-2, 2]}
    return experiment(
        plant,
        {
            "S": {"type": "shgo", "theta": 8, "saturation": box},
            "F": {"type": "fhgo1", "theta": 6, "delta": 3, "saturation": box},
        },
        end=2.0,
        step=step,
        measurement=dict(measurement),
        controller=CONTROLLER,
    )


def same_as_alone(base: Experiment, members: Members, i: int, block: Block) -> None:
    one = simulate(base.varied(members.of_observers(base).changes(i)))
    for j, label in enumerate(base.observers):
        for name, values in one.observers[label].metrics.items():
            np.testing.assert_array_equal(block.metrics[name][i, j], values, err_msg=f"{label} {name}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("measurement", "step"),
    [
        ({"sampling": {"period": 0.1}, "noise": [GAUSSIAN]}, 0.01),
        ({"sampling": {"period": 0.2}, "noise": [GAUSSIAN]}, None),
    ],
)
def test_in_lanes_as_alone(measurement: Mapping[str, Any], step: float | None) -> None:
    base = loops(step, measurement)
    if step is None:  # what jumps in a state is left to controlled steps
        base = base.varied({"controller.anti_windup": "none", "controller.saturation": None})
    assert fits(prepare(base))
    columns: dict[str, Any] = {
        "observers.*.theta": RANDOM.uniform(5, 9, COUNT),
        "seed": np.arange(COUNT),
        "plant.initial.x1": RANDOM.uniform(0.2, 0.6, COUNT),
        "plant.parameters.k": RANDOM.uniform(0.5, 1.5, COUNT),
    }
    members = Members({path: np.asarray(column) for path, column in columns.items()}, COUNT)
    block = compute(base, members)
    assert "recovery" in block.metrics
    for i in (0, 7, COUNT - 1):
        same_as_alone(base, members, i, block)


@pytest.mark.costly
def test_numbers_of_the_controller_as_alone() -> None:
    """They change no equations: its literals, its bounds, its period."""
    base = loops(0.01, {"sampling": {"period": 0.1}, "noise": [GAUSSIAN]})
    columns: dict[str, Any] = {
        "controller.saturation.u": [[-b, b] for b in (1.0, 1.5, 2.0, 2.5)],
        "controller.law.u": [f"-k*x1 - {c}*x2 - xi" for c in (1.5, 2.0, 2.5, 3.0)],
        "controller.period": [0.05, 0.1, 0.2, 0.1],
    }
    runs = [prepare(base.varied({path: values[i] for path, values in columns.items()})) for i in range(4)]
    assert len({id(run.structure) for run in runs}) == 1
    for i, values in enumerate(zip(*columns.values(), strict=True)):
        changes = dict(zip(columns, values, strict=True))
        again = simulate(Experiment(dict(base.varied(changes).source.data), name="again"))
        one = simulate(runs[i].experiment)
        np.testing.assert_array_equal(one.closed_loop["F"].x, again.closed_loop["F"].x)
        assert one.closed_loop["F"].cost == again.closed_loop["F"].cost


def test_recovery_can_be_tuned() -> None:
    """A goal of closed loops alone: other runs do not have it."""
    base = loops(0.02, {"sampling": {"period": 0.1}, "noise": [GAUSSIAN]})
    tune = Tune.model_validate(
        {"gains": {"observers.S.theta": {"log": [4, 10]}}, "minimise": "recovery(S, x1)", "seeds": 2, "budget": 20}
    )
    (task,) = tasks(base, tune)
    found = measured(task, np.array([[6.0], [8.0]]), [0, 1])
    one = simulate(base.varied({"observers.S.theta": 8.0, "seed": 1}))
    assert found[1, 0] == one.observers["S"].metrics["recovery"][0]
    opened = base.varied({"controller": None, "plant.inputs.u": "0", "plant.parameters": None})
    with pytest.raises(Problem, match="only metrics without a window can be tuned"):
        tasks(opened, tune)
