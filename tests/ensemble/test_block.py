"""A member in a block has the numbers that it has alone; one that fails stops nobody."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, chain, experiment

from hgorun import Experiment, simulate
from hgorun.ensemble.blocks.block import Block, compute
from hgorun.ensemble.members.members import Members, written_out
from hgorun.errors import ConfigError
from hgorun.result.records.status import STATUSES


def van_der_pol() -> Experiment:
    return experiment(
        VAN_DER_POL,
        {"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo1", "theta": 2, "delta": 3}},
        end=2.0,
        step=0.01,
        measurement={"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]},
    )


def equal(block: Block, i: int, base: Experiment, members: Members) -> None:
    """Member i has the bits of the member alone."""
    alone = simulate(base.varied(members.of_observers(base).changes(i)))
    for j, label in enumerate(block.observers):
        one = alone.observers[label]
        for name, values in block.metrics.items():
            assert values[i, j].tobytes() == np.asarray(one.metrics[name], dtype=float).tobytes(), (name, label)
        assert STATUSES[block.status[i, j]] == one.status
        assert block.reason[i, j] == (one.reason or "")
        for found, at in ((block.status_at, one.status_at), (block.diverged_at, one.diverged_at)):
            assert np.array_equal(found[i, j], np.nan if at is None else at, equal_nan=True)


def test_a_member_has_the_numbers_that_it_has_alone() -> None:
    base = van_der_pol()
    members = Members.of({"observers.*.theta": [2.0, 3.0, 4.0], "seed": [0, 1, 2]})
    block = compute(base, members)
    for i in range(3):
        equal(block, i, base, members)


def test_only_the_metrics_that_are_asked_for_are_kept() -> None:
    block = compute(van_der_pol(), Members.of({"seed": [1]}), metrics=("rmse", "hf"))
    assert list(block.metrics) == ["rmse", "hf"]
    with pytest.raises(ConfigError, match="no metric is called 'rms'"):
        compute(van_der_pol(), Members.of({"seed": [1]}), metrics=("rms",))


def test_a_member_that_fails_does_not_stop_the_others() -> None:
    base = van_der_pol()
    block = compute(base, Members.of({"observers.SHGO.theta": [2.0, -1.0, 3.0]}))
    assert [bool(text) for text in block.error] == [False, True, False]
    assert "theta" in block.error[1]
    assert [STATUSES[s] for s in block.status[:, 0]] == ["ok", "failed", "ok"]
    assert np.all(np.isinf(block.metrics["rmse"][1]))
    assert np.all(np.isfinite(block.metrics["rmse"][[0, 2]]))


def test_all_observers_have_the_key_that_is_varied() -> None:
    with pytest.raises(ConfigError, match="no observer has the key 'thita'"):
        compute(van_der_pol(), Members.of({"observers.*.thita": [1.0]}))


def test_members_can_be_sliced() -> None:
    members = Members.of({"a.b": [1.0, 2.0, 3.0], "c": ["x", "y", [1, 2]]})
    assert [members[1:].changes(i) for i in range(2)] == [{"a.b": 2.0, "c": "y"}, {"a.b": 3.0, "c": [1, 2]}]
    assert members[[2, 0]].changes(0)["a.b"] == 3.0
    assert len(members[::2]) == 2
    with pytest.raises(ValueError, match="different lengths"):
        Members.of({"a": [1, 2], "b": [1]})


def test_a_key_of_all_observers_leaves_out_blocks_that_exclude_it() -> None:
    """A Kalman filter whose noise is given as Q has no theta, others have one."""
    filters: dict[str, dict[str, Any]] = {
        "Q": {"type": "ekf", "Q": {"x2": 1}},
        "theta": {"type": "ekf", "theta": 2},
        "S": {"type": "shgo", "theta": 2},
    }
    sampled = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}
    base = experiment(chain(2, "-x1"), filters, measurement=sampled)
    assert written_out(base, "observers.*.theta") == ["observers.theta.theta", "observers.S.theta"]
    assert written_out(base, "observers.*.Q") == ["observers.Q.Q"]
