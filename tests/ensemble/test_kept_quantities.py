"""Quantities that a sweep keeps besides metrics: those of every member alone, wherever they are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ensembles import base, ensemble

import hgorun
from hgorun.ensemble.sweep import Place, sweep_to
from hgorun.errors import Problem
from hgorun.result.quantities.quantities import measure_quantity, read_quantity
from hgorun.simulation.simulate import simulate

AXES = {"observers.SHGO.theta": [2.0, -1.0, 5.0], "seed": {"count": 2}}  # a gain that is refused
TEXTS = ["std('SHGO', x2)", "rmse('FHGO', x1, 0.1, 0.4)", "largest('small', x1)", "difference('SHGO', 'FHGO', x2)"]


@pytest.mark.measured
@pytest.mark.slow
def test_they_are_those_of_every_member_alone(tmp_path: Path) -> None:
    place = Place.of(tmp_path / "small.sweep.h5")
    sweep_to(ensemble(AXES, keep={"metrics": ["rmse"], "quantities": TEXTS, "trajectories": {"every": 3}}), place)
    collected, folder = hgorun.read_sweep(place.file), hgorun.read_sweep(place.folder)
    asked = [read_quantity(text, ("small",)) for text in TEXTS]
    for i in range(6):
        theta, seed = (collected.axes[axis][i] for axis in AXES)
        if theta < 0:
            expected = [np.inf] * len(asked)
        else:
            alone = simulate(base().varied({"observers.SHGO.theta": float(theta), "seed": int(seed)}))
            expected = [measure_quantity(q, {"small": alone}) for q in asked]
        assert [collected.quantities[str(q)][i] for q in asked] == expected
        assert [folder.quantities[str(q)][i] for q in asked] == expected
    kept = collected.trajectories
    assert kept is not None
    assert kept.member.tolist() == [0, 3]
    assert np.isfinite(kept.xhat[0]).all()
    assert np.isnan(kept.xhat[1]).all()
    some = collected.where(collected.at("seed", 1))
    assert [values.size for values in some.quantities.values()] == [3] * len(asked)


def test_xarray_has_them_by_their_texts() -> None:
    xarray = pytest.importorskip("xarray")
    found = hgorun.sweep(base(), {"seed": [0, 1]}, {"metrics": ["rmse"], "quantities": ["std('SHGO', x2)"]}).to_xarray()
    assert isinstance(found, xarray.Dataset)
    assert found["quantities"].dims == ("seed", "quantity")
    assert np.isfinite(found["quantities"]).all()


@pytest.mark.parametrize("text", ["difference(SHGO, FHGO, x2)", 'difference("SHGO", FHGO, x2)'])
def test_labels_may_stand_without_quotes_as_in_claims(text: str) -> None:
    quoted = ensemble({"seed": [0]}, keep={"quantities": [TEXTS[-1]]}).quantities
    assert ensemble({"seed": [0]}, keep={"quantities": [text]}).quantities == quoted


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("std", "expected a quantity such as"),
        ("std(HGO, x2)", "'HGO' is no observer's label that may be without quotes"),
        ("std(SHGO, x2) / std(SHGO, x1)", "expected one quantity and nothing beside it; claims take"),
        ("2*std('SHGO', x2)", "expected one quantity and nothing beside it"),
        ("stdd('SHGO', x2)", "no quantity is called 'stdd'. Did you mean"),
        ("exponent('SHGO', x2)", "it is not measured on one member"),
        ("analysis('SHGO', beta)", "it is not measured on one member"),
        ("std('other/SHGO', x2)", "it is not measured on one member"),
        ("std('HGO', x2)", "no observer is called 'HGO'. Did you mean"),
        ("std('SHGO', x3)", "no state is called 'x3'"),
        ("std('SHGO', x2, 0, 9)", "the run lasts from 0 to 0.5"),
        ("std('SHGO', x2, 0.101, 0.102)", "no output point lies in this window"),
    ],
)
def test_what_no_member_has_is_refused(text: str, words: str) -> None:
    with pytest.raises(Problem, match=words) as caught:
        ensemble({"seed": [0]}, keep={"quantities": ["std('SHGO', x2)", text]}).check()
    assert caught.value.path == ("keep", "quantities", 1)
