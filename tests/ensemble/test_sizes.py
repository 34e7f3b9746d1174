"""How many members there are changes none of them, whichever lanes of the vector registers they fill."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment

from hgorun import Experiment, simulate
from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.members.members import Members

MOST = 40
CHAIN = {"type": "integrator_chain", "n": 2, "phi": "-x1 - 0.1*x2", "initial": {"x1": 1, "x2": 0}}


def chain(observers: dict[str, dict[str, Any]], step: float | None = 5e-3) -> Experiment:
    measurement = {"sampling": {"period": 0.03}, "noise": [{"type": "gaussian", "std": 0.05}]}
    return experiment(CHAIN, observers, end=0.3, step=step, measurement=measurement)


SHGO, FHGO = {"type": "shgo", "theta": 4}, {"type": "fhgo2", "theta": 3, "r": 2}
OF: dict[str, Experiment] = {
    "one observer": chain({"A": SHGO}),
    "a varying gain": chain({"A": {"type": "direct", "theta": 4}}),
    "two observers": chain({"A": SHGO, "F": FHGO}),
    "automatic steps": chain({"A": SHGO}, None),
    "held noise": experiment(
        VAN_DER_POL,
        {"A": SHGO, "F": FHGO},
        end=0.3,
        step=5e-3,
        measurement={"noise": [{"type": "gaussian", "std": 0.05, "hold": 0.02}]},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", OF)
def test_every_number_of_members_from_1_to_40(what: str) -> None:
    base = OF[what]

    def rmse(size: int) -> np.ndarray:
        return compute(base, Members.of({"seed": np.arange(size)}), metrics=("rmse",)).metrics["rmse"]

    everyone = rmse(MOST)
    for seed in (0, 1, MOST - 1):
        alone = simulate(base.varied({"seed": seed})).observers
        assert [list(one.metrics["rmse"]) for one in alone.values()] == everyone[seed].tolist()
    for size in range(1, MOST):
        np.testing.assert_array_equal(rmse(size), everyone[:size], err_msg=f"{size} members")


@pytest.mark.parametrize("window", [[0.1, 0.2], [0.1, 0.3]])
def test_automatic_steps_where_metrics_end_before_the_run(window: list[float]) -> None:
    """Then late errors are looked at beside the metrics, of which they are none."""
    base = OF["automatic steps"].varied({"metrics.window": window})
    found = compute(base, Members.of({"seed": np.arange(3)}), metrics=("rmse",)).metrics["rmse"]
    alone = simulate(base.varied({"seed": 2})).observers["A"]
    assert found[2].tolist() == [list(alone.metrics["rmse"])]
