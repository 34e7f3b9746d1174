"""What a plant declares by name is read by name."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from hgorun.errors import Problem
from hgorun.plants.base import Plant
from hgorun.plants.bioreactor_gauthier import GauthierBioreactor
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.plants.contois import Contois
from hgorun.plants.phytoplankton import Phytoplankton
from hgorun.plants.van_der_pol import VanDerPol


def reordered(cls: type[Plant]) -> type[Plant]:
    """The same plant with its parameters declared in the reverse order."""
    parameters = dict(reversed(list(cls.known_parameters.items())))
    return type(cls.__name__, (cls,), {"known_parameters": parameters, "__module__": cls.__module__})


def built(cls: type[Plant]) -> BuiltPlant:
    block: dict[str, Any] = {"type": "plant", "inputs": {name: 0.1 for name in cls.known_inputs}}
    plain = cls.model_construct()
    block["initial"] = dict(zip(plain.state_names, (0.05, 0.04, 0.3), strict=False))
    return build_plant(cls.model_validate(block))


@pytest.mark.parametrize("cls", [Contois, GauthierBioreactor, Phytoplankton])
def test_the_order_of_the_parameters_changes_nothing(cls: type[Plant]) -> None:
    one, other = built(cls), built(reordered(cls))
    assert one.model.parameters != other.model.parameters
    x, z = ca.DM(one.initial), ca.DM([0.05, 0.02, 0.4][: one.model.n])
    for name in ("inverse", "transform", "untransform"):
        first, second = getattr(one.model, name), getattr(other.model, name)
        assert (first is None) == (second is None)
        if first is not None:
            at = x if name == "transform" else z
            np.testing.assert_array_equal(
                np.asarray(first(at, ca.DM(one.parameters))), np.asarray(second(at, ca.DM(other.parameters)))
            )


def test_unknown_names_of_several_blocks_are_told_at_once() -> None:
    wrong = {"type": "van_der_pol", "parameters": {"mu": 1, "k": 2}, "initial": {"x1": 1, "x_2": 0, "x3": 0}}
    with pytest.raises(Problem) as raised:
        build_plant(VanDerPol.model_validate(wrong))
    told = [raised.value, *raised.value.others]
    assert [one.path for one in told if isinstance(one, Problem)] == [
        ("plant", "initial", "x_2"),
        ("plant", "initial", "x3"),
        ("plant", "parameters", "k"),
    ]
