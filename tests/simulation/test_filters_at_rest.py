"""Which states come to rest at zero, of equations whose rest is known."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from hgorun.simulation.error_dynamics.filters_at_rest import not_at_zero, rates_and_sizes, values_of
from hgorun.symbolic.states import StateBlock, Symmetric

th, w, x = ca.SX.sym("th"), ca.SX.sym("w"), ca.SX.sym("x")


@pytest.mark.parametrize(
    ("rates", "starts", "expected"),
    [
        ({"w": -w}, {"w": 0.0}, ()),
        ({"th": -th}, {"th": 6.0}, ()),
        ({"w": 3 * x - x - x - x - w}, {"w": 0.0}, ()),  # zero but for rounding
        ({"w": 0.01 * x - w}, {"w": 0.0}, ("w",)),  # follows the plant
        ({"th": 2 - th}, {"th": 6.0}, ("th",)),
        ({"th": 2 - th}, {"th": 0.0}, ("th",)),
        ({"th": th * (2 - th)}, {"th": 6.0}, ("th",)),  # rests at 0, too, but does not come there
        ({"th": 1 - 2 / th}, {"th": -6.0}, ("th",)),  # no number at 0, and grows for ever on this side
        ({"th": ca.SX(0)}, {"th": 6.0}, ("th",)),  # stays where it starts
        ({"th": ca.SX(0)}, {"th": 0.0}, ()),  # an integrator of the innovation
        ({"th": ca.SX(1)}, {"th": 0.0}, ("th",)),  # a clock
        ({"th": 2 - th, "w": th - 2 - w}, {"th": 6.0, "w": 0.0}, ("th",)),  # w is at rest with th alone
    ],
)
def test_filters_are_told_from_states_that_rest_elsewhere(
    rates: dict[str, ca.SX], starts: dict[str, float], expected: tuple[str, ...]
) -> None:
    places = {name: StateBlock(1 + i, ()) for i, name in enumerate(rates)}
    names = {"th": th, "w": w}
    z = ca.vertcat(x, *[names[name] for name in rates])
    function = ca.Function("rates", [z], rates_and_sizes(rates, places, z))
    at = np.array([0.1, *(0.0 for _ in rates)])
    found = not_at_zero(places, {n: np.array(v) for n, v in starts.items()}, at, lambda z: values_of(function, z))
    assert found == expected


def test_a_matrix_is_named_once_and_what_is_before_it_not_at_all() -> None:
    start = Symmetric(3 * np.eye(2))
    places = {"w": StateBlock.of(0, np.zeros(2)), "S": StateBlock.of(2, start)}
    z = ca.SX.sym("z", 5)
    rates = {name: -place.symbol(z) for name, place in places.items()}
    rates["S"] = rates["S"] + ca.SX.eye(2)
    function = ca.Function("rates", [z], rates_and_sizes(rates, places, z))
    starts: dict[str, np.ndarray | Symmetric] = {"w": np.zeros(2), "S": start}
    assert not_at_zero(places, starts, np.ones(5), lambda z: values_of(function, z)) == ("S",)
