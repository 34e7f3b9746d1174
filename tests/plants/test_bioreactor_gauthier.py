"""The bioreactor against (22) and the invariance of eta_1 + eta_2 = s_in."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.plants.bioreactor_gauthier import GauthierBioreactor
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.symbolic.lower_triangular import state_affine_form


def plant() -> BuiltPlant:
    return build_plant(
        GauthierBioreactor.model_validate(
            {"type": "bioreactor_gauthier", "inputs": {"u": 0.08}, "initial": {"eta1": 0.05, "eta2": 0.04}}
        )
    )


def test_in_the_triangular_coordinates_the_model_is_22() -> None:
    built = plant()
    form = state_affine_form(built.model, built.initial, built.parameters)
    for x1, ratio, u in np.random.default_rng(0).uniform(0.02, 0.9, (10, 3)):
        x2 = 3 * x1 * ratio  # eta_2 > 0
        expected = [
            x2 - u * x1,
            (0.1 * u / (3 * x1**2) + 2 / x1) * x2**2 - (3 + u + 0.2 * u / x1) * x2 + 0.3 * u,
        ]
        found = form.model.f(0, ca.DM([x1, x2]), ca.DM(u), ca.DM(built.parameters))
        np.testing.assert_allclose(np.asarray(found).ravel(), expected, rtol=1e-10)


def test_the_coordinates_lead_back() -> None:
    built = plant()
    there, back = built.model.transform, built.model.untransform
    assert there is not None
    assert back is not None
    eta, p = ca.DM([0.03, 0.06]), ca.DM(built.parameters)
    np.testing.assert_allclose(np.asarray(there(eta, p)).ravel(), [0.03, 3 * 0.03 * 0.06 / 0.09], rtol=1e-15)
    np.testing.assert_allclose(np.asarray(back(there(eta, p), p)).ravel(), [0.03, 0.06], rtol=1e-14)


def test_the_sum_decays_to_the_feed() -> None:
    """(eta_1 + eta_2 - s_in)' = -u (eta_1 + eta_2 - s_in): the paper's start is on the border of X."""
    built = plant()
    for eta in np.random.default_rng(1).uniform(0.01, 0.1, (5, 2)):
        rates = np.asarray(built.model.f(0, ca.DM(eta), ca.DM(0.3), ca.DM(built.parameters))).ravel()
        np.testing.assert_allclose(rates.sum(), -0.3 * (eta.sum() - 0.1), atol=1e-15)
