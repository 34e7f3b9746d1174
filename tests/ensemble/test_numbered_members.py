"""The members of an ensemble: numbered, and each the same whichever others are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from ensembles import ensemble

from hgorun.ensemble.members.recipe import ensemble_of, recipe_of
from hgorun.errors import ConfigError, Problem

THETAS = "observers.*.theta"


def test_a_product_has_every_combination_the_last_axis_first() -> None:
    found = ensemble({"observers.SHGO.theta": [2.0, 3.0], "seed": {"count": 3}})
    assert (found.dimensions, found.size) == ({"observers.SHGO.theta": 2, "seed": 3}, 6)
    values = found.values(0, 6)
    assert values["seed"].tolist() == [0, 1, 2, 0, 1, 2]
    assert values["observers.SHGO.theta"].tolist() == [2, 2, 2, 3, 3, 3]
    assert found.members(4, 5).changes(0) == {"observers.SHGO.theta": 3.0, "seed": 1}


def test_zip_takes_the_first_with_the_first() -> None:
    found = ensemble({"observers.SHGO.theta": [2.0, 3.0], "seed": [5, 1]}, combine="zip")
    assert found.dimensions == {"member": 2}
    assert found.members(0, 2).changes(1) == {"observers.SHGO.theta": 3.0, "seed": 1}


def test_sobol_points_are_evenly_spread_and_do_not_depend_on_each_other() -> None:
    axes = {
        "solver.method": ["rk4", "euler"],
        "observers.SHGO.theta": {"log": [2, 32, 64]},
        "observers.FHGO.theta": {"linear": [1, 2, 64]},
        "plant.initial.x1": {"normal": [0, 1], "draws": 64},
        "seed": {"count": 64},
    }
    found = ensemble(axes, combine="sobol")
    found.check()
    values = found.values(0, 64)
    assert found.dimensions == {"member": 64}
    counts, _ = np.histogram(np.log2(np.array(values["observers.SHGO.theta"], float)), bins=16, range=(1, 5))
    assert counts.tolist() == [4] * 16
    pairs, _, _ = np.histogram2d(
        np.log2(values["observers.SHGO.theta"]), values["observers.FHGO.theta"], bins=8, range=[[1, 5], [1, 2]]
    )
    assert pairs.tolist() == [[1] * 8] * 8
    assert sorted(values["solver.method"]) == ["euler"] * 32 + ["rk4"] * 32
    assert np.all(np.isfinite(values["plant.initial.x1"]))
    assert values["seed"].tolist() == list(range(64))
    later = found.values(37, 50)
    assert {path: v.tolist() for path, v in later.items()} == {p: v[37:50].tolist() for p, v in values.items()}


@pytest.mark.parametrize(
    ("axes", "more", "place", "words"),
    [
        ({"observers.G.theta": [1]}, {}, "axes/observers.G.theta", "no observer is called 'G'. Known: SHGO"),
        (
            {"observers.SGHO.theta": [1]}, {}, "axes/observers.SGHO.theta",
            "no observer is called 'SGHO'. Did you mean `SHGO`? Known: SHGO, FHGO",
        ),
        ({"observers.*.thetta": [1]}, {}, "axes/observers.*.thetta", "the key 'thetta'. Did you mean `theta`?"),
        ({"seed": [1]}, {"keep": {"metrics": ["rms"]}}, "keep/metrics/0", "'rms'. Did you mean `rmse`? Known: rmse"),
        ({"observers.SHGO.thta": [1]}, {}, "axes/observers.SHGO.thta", "unknown key 'thta'. Did you mean `theta`?"),
        ({"observers.SHGO.theta": [-1, 0]}, {}, "axes/observers.SHGO.theta", "expected a number above 0, found -1"),
        ({"observers.*.thta": [1]}, {}, "axes/observers.*.thta", "no observer has the key 'thta'"),
        (
            {"observers.*.theta": [1], "observers.SHGO.theta": [2]}, {}, "axes/observers.SHGO.theta",
            "it changes observers.SHGO.theta, and so does the axis observers.*.theta",
        ),
        (
            {"observers.FHGO.theta": [1], "observers.*.theta": [2]}, {}, "axes/observers.*.theta",
            "it changes observers.FHGO.theta, and so does the axis observers.FHGO.theta",
        ),
        ({"solver.step": {"linear": [0.1, 0.2, 1]}}, {}, "axes/solver.step", "one value cannot be both 0.1 and 0.2"),
        ({"solver.step": {"log": [0.1, 0.2, 1]}}, {}, "axes/solver.step", "one value cannot be both 0.1 and 0.2"),
        ({"foo": [1]}, {}, "axes/foo", "unknown key 'foo'"),
        ({"plant.initial.x3": [1, 2]}, {}, "axes/plant.initial.x3", "unknown name 'x3'; known here: x1, x2"),
        (
            {"observers.SHGO.initial.x3": {"linear": [1, 2, 9]}, "seed": [0]}, {}, "axes/observers.SHGO.initial.x3",
            "observers.SHGO.initial: unknown state 'x3'; known here: x1, x2",
        ),
        (
            {"theta": [1]}, {}, "axes/theta",
            "Did you mean `observers.FHGO.theta` or `observers.SHGO.theta`? observers.*.theta is that of all observers",
        ),
        ({"shgo.theta": [1]}, {}, "axes/shgo.theta", "Did you mean `observers.SHGO.theta`?"),
        ({"observers.SHGO.poles[0]": [1]}, {}, "axes/observers.SHGO.poles[0]", "`observers.SHGO.poles.0`?"),
        ({"seed.x": [1]}, {}, "axes/seed.x", "expected a whole number, found a mapping"),
        ({"solver.step": {"count": 3}}, {}, "axes/solver.step", "count makes seeds"),
        (
            {"seed": [1, 2], "observers.SHGO.theta": [2]}, {"combine": "zip"}, "axes",
            "zip needs axes with the same number of values, found seed 2, observers.SHGO.theta 1",
        ),
        ({"seed": [1, 2]}, {"combine": "sobol"}, "axes", "lists alone do not say how many members"),
        ({"seed": {"count": 10**6}, "solver.step": {"linear": [0.01, 0.02, 10**6]}}, {}, "axes", "more than"),
        ({"seed": [1]}, {"keep": {"metrics": ["rms"]}}, "keep/metrics/0", "no metric is called 'rms'"),
        (
            {"seed": [1]}, {"keep": {"metrics": ["rmse"], "trajectories": {"worst": 2, "by": "sup"}}},
            "keep/trajectories/by", "expected one of rmse; found 'sup'",
        ),
        (
            {"seed": [1]}, {"keep": {"trajectories": {"worst": 2, "by": "rmse", "observer": "X"}}},
            "keep/trajectories/observer", "expected one of SHGO, FHGO; found 'X'",
        ),
        ({"time.end": [1]}, {"keep": {"trajectories": "all"}}, "keep/trajectories", "trajectories need one grid"),
    ],
)  # fmt: skip
def test_what_no_member_can_be_made_of_is_refused(
    axes: Mapping[str, Any], more: Mapping[str, Any], place: str, words: str
) -> None:
    with pytest.raises(Problem) as caught:
        ensemble(axes, **more).check()
    assert "/".join(map(str, caught.value.path)) == place
    assert words in str(caught.value)


def test_a_wrong_value_of_a_member_is_told_at_its_key() -> None:
    made = ensemble_of(recipe_of(ensemble({"measurement.sampling.period": ["0.02s", 0.1]})))
    with pytest.raises(ConfigError, match=r"^measurement\.sampling\.period: `0\.02s`: a number has no unit here"):
        made.base.varied(made.members(0, 1).changes(0))


def test_one_value_that_fits_is_enough() -> None:
    ensemble({"observers.SHGO.theta": [-1.0, 2.0]}).check()
    ensemble({THETAS: [2.0]}).check()
    ensemble({"observers.SHGO.initial.x2": [1.0]}).check()


def test_one_value_that_is_both_ends_and_axes_beside_each_other_are_taken() -> None:
    ensemble({"solver.step": {"linear": [0.01, 0.01, 1]}, "observers.SHGO.theta": [2], "seed": [0]}).check()
    ensemble({"observers.SHGO.theta": {"log": [1, 2, 1]}}, combine="sobol").check()
