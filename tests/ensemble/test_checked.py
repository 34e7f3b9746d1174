"""The integration error of some members, where steps or tolerances are given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hgorun
from hgorun.ensemble.blocks import checked
from hgorun.ensemble.statistics.statistics import largest_errors
from hgorun.errors import ConfigError
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.tables import ensemble as tables
from hgorun.tables.ensemble_data import as_json

BASE = {
    "time": {"end": 1, "output_step": 0.1},
    "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
    "observers": {"S": {"type": "shgo", "theta": 2}},
    "solver": {"method": "rk4", "step": 0.1},
}


@pytest.mark.parametrize("seed", [0, 7, 2**63 - 1])
def test_at_most_three_members_are_chosen_one_of_each_hundred(seed: int) -> None:
    assert [len(checked.chosen(size, seed)) for size in (0, 99, 100, 299, 300, 10**6)] == [0, 0, 1, 2, 3, 3]
    members = checked.chosen(1000, seed)
    assert members == sorted(set(members))
    assert 0 <= members[0] <= members[-1] < 1000
    assert checked.chosen(1000, seed + 1 if seed < 7 else seed - 1) != members


def test_members_that_are_chosen_have_the_error_that_they_have_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checked, "chosen", lambda size, seed: [1, 2])  # one that there is not, too
    path = tmp_path / "theta.sweep.h5"
    found = hgorun.sweep(hgorun.load(BASE), {"observers.S.theta": [2, 3]}, {"metrics": ["rmse"]}, output=path)
    alone = hgorun.simulate({**BASE, "observers": {"S": {"type": "shgo", "theta": 3}}}).integration_error
    assert alone is not None
    np.testing.assert_array_equal(found.integration_error, [[np.nan, np.nan], list(alone.values())])
    for stored in (path, tmp_path / "theta.sweep"):
        np.testing.assert_array_equal(hgorun.read_sweep(stored).integration_error, found.integration_error)
    one = tables.compared(found, ())
    assert largest_errors(found) == (1, alone)
    assert "integration error of the member checked: plant" in tables.text([one])
    assert as_json(one)["integration_error"] == {"members": 1, "largest": alone}
    assert largest_errors(found.where(np.array([True, False]))) == (0, {})


@pytest.mark.costly
def test_of_automatic_steps_all_members_have_an_error() -> None:
    found = hgorun.sweep(hgorun.load({**BASE, "solver": {}}), {"observers.S.theta": [2, 3]}, {"metrics": ["rmse"]})
    assert "integration error, the largest of all members: plant" in tables.text([tables.compared(found, ())])


@pytest.mark.costly
def test_a_member_that_fails_is_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checked, "chosen", lambda size, seed: [0, 1])
    found = hgorun.sweep(hgorun.load(BASE), {"observers.S.theta": [-1, 2]}, {"metrics": ["rmse"]})
    assert np.isnan(found.integration_error).all(axis=1).tolist() == [True, False]


def test_a_member_whose_error_cannot_be_estimated_alone_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(_: Experiment) -> Result:
        raise ConfigError("too large")

    monkeypatch.setattr(checked, "chosen", lambda size, seed: [1])
    monkeypatch.setattr(checked, "simulate", refuses)
    found = hgorun.sweep(hgorun.load(BASE), {"observers.S.theta": [2, 3]}, {"metrics": ["rmse"]})
    assert np.isnan(found.integration_error).all()
    assert found.all_ok
    monkeypatch.setattr(checked, "LONG", 10)  # then nobody asks
    monkeypatch.setattr(checked, "simulate", None)
    assert np.isnan(hgorun.sweep(hgorun.load(BASE), {"observers.S.theta": [2, 3]}).integration_error).all()
