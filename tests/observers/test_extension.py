"""The key ``extend``: observers of a chain of n + m integrators, where n of them are the plant."""

from __future__ import annotations

import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline, simulated, sinusoid

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS
from hgorun.observers.extension import Extendable
from hgorun.testing import check_observer

FAMILIES: dict[str, Block] = {
    "shgo": {"theta": 3},
    "nested": {"type": "shgo", "theta": 3, "nested": {"M": [0.4, 0.5]}},
    "fhgo2": {"theta": 3, "r": 2},
    "integral": {"theta": 3, "r": 1},
    "lowpass": {"theta": 3, "rho": 0.1},
    "treangle": {"theta": 3},
    "low_power": {"theta": 3},
    "peaking-free": {"type": "low_power", "theta": 3, "saturate": [1.5, 1]},
    "homogeneous": {"theta": 3},
    "switched": {"theta_1": 5, "theta_2": 3, "delta": 0.1},
    "piecewise": {"theta_1": 5, "theta_2": 3, "d": 0.1},
    "updated": {"theta_0": 3, "delta": 0.1},
    "dead_zone": {"theta": 3, "internal": {"sigma": 0.01}},
    "stubborn": {"theta": 3, "internal": {"sigma": 0.5}},
    "hg_ekf": {"theta": 2},
    "aekf": {"theta_1": 2, "m": 0.05},
    "shgo_riccati": {"theta": 2},
    "fhgo1": {"theta": 2, "delta": 3},
    "fhgo2_nuos": {"theta": 2, "r": 1},
}
OF_SAMPLES: dict[str, Block] = {
    "impulsive": {"theta": 2},
    "impulsive_riccati": {"theta": 2},
    "hg_ekf of samples": {"type": "hg_ekf", "theta": 2, "update": "jump", "interval": 0.1},
}
PUNCTUAL: dict[str, Block] = {"prescribed_time": {"T": 3, "mu_max": 4, "poles": -2}}
PREDICTING: dict[str, Block] = {"predictor_chain": {"theta": 2, "m": 2}}
ALL = FAMILIES | OF_SAMPLES | PUNCTUAL | PREDICTING
LATE: Block = {"sampling": {"period": 0.1}, "delay": 0.05, "noise": sinusoid(0.03, 11)}


def block(name: str) -> Block:
    return {"type": name, **ALL[name]}


def test_all_families_of_chains_are_looked_at() -> None:
    known = {name for name, family in OBSERVERS.all().items() if issubclass(family, Extendable)}
    assert known == {block(name)["type"] for name in ALL}


def blocks(families: dict[str, Block], **more: object) -> dict[str, Block]:
    return {name: {**block(name), **more} for name in families}


@pytest.mark.measured("late samples", "late")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("measurement", "families"),
    [({}, FAMILIES | PUNCTUAL), (LATE, FAMILIES | OF_SAMPLES), ({"delay": 0.4}, PREDICTING)],
    ids=["continuous", "late samples", "late"],
)
def test_of_a_chain_of_integrators_it_is_the_observer_of_one_order_more(
    measurement: Block, families: dict[str, Block]
) -> None:
    """phi = 0: the unknown input is the state x_(n+1)."""
    short = {**chain(2), "disturbance": {"x2": "0.5"}}
    one = simulated(short, blocks(families, extend=1), end=4, step=0.01, measurement=measurement)
    two = simulated(chain(3), blocks(families), end=4, step=0.01, measurement=measurement)
    for name, found in one.observers.items():
        expected = two.observers[name].xhat
        assert np.ptp(expected[:, 2]) > 0.1
        np.testing.assert_allclose(found.xhat, expected[:, :2], atol=1e-11, err_msg=name)
        if name != "peaking-free":  # whose state is shown clipped
            sigma = found.internal["d" if name in ("dead_zone", "stubborn") else "sigma"].reshape(len(expected), -1)
            np.testing.assert_allclose(sigma[:, 0], expected[:, 2], atol=1e-11, err_msg=name)


@pytest.mark.parametrize("coordinates", ["original", "canonical"])
def test_the_standard_observer_with_it_is_the_extended_one(coordinates: str) -> None:
    """Also through J^-1, and with a plant that is nonlinear."""
    start: Block = {"initial": {"x1": 1.4, "x2": 14}, "coordinates": coordinates, "theta": 3, "extend": 2}
    both = {name: {"type": name, **start} for name in ("extended", "shgo")}
    plant = {**CONTOIS, "disturbance": {"x2": "0.3 + t/20"}}
    found = simulated(plant, both, end=6, step=0.01, measurement={"noise": sinusoid(0.01, 7)}).observers
    np.testing.assert_allclose(found["shgo"].xhat, found["extended"].xhat, rtol=1e-9)
    np.testing.assert_allclose(found["shgo"].internal["sigma"], found["extended"].internal["sigma"], atol=1e-8)


def test_one_unknown_input_for_each_output() -> None:
    plant = inline({"a": "b", "b": "-a", "c": "-c"}, ["a", "c"], disturbance={"b": "0.3", "c": "-0.8"})
    observers = {name: {"type": name, "theta": 6, "extend": 1} for name in ("fhgo2", "treangle", "integral")}
    for found in simulated(plant, observers, end=15).observers.values():
        np.testing.assert_allclose(found.internal["sigma"][-1].ravel(), [0.3, -0.8], atol=1e-5)


def test_a_ramp_is_followed_by_two_integrators_behind_a_filter() -> None:
    plant = {**chain(2, "-x1 - sin(x2)"), "disturbance": {"x2": "0.7*t - 1"}}
    found = simulated(plant, {"F": {"type": "fhgo2", "theta": 5, "extend": 2}}, end=15).observers["F"]
    np.testing.assert_allclose(found.internal["sigma"][-1], [0.7 * 15 - 1, 0.7], atol=1e-5)


@pytest.mark.costly
def test_poles_are_those_of_the_longer_chain() -> None:
    made = experiment(chain(2), {"F": {"type": "fhgo2", "theta": 5, "r": 1, "extend": 1, "poles": [-1, -1.5, -2, -3]}})
    found = hgorun.analyze(made).observers["F"].values
    poles = np.array(found["poles"])
    np.testing.assert_allclose(np.sort(poles.real), [-3, -2, -1.5, -1])
    assert found["hurwitz"]
    assert hgorun.Experiment(made.resolved()).resolved() == made.resolved()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extend": 0}, "extend"),
        ({"extend": 1, "poles": [-1, -2]}, "expected 3 numbers, or one number for all; found 2"),
        ({"extend": 1, "nested": {"M": [1]}}, "expected 2 numbers for the chain"),
        ({"extend": 1, "initial": {"sigma_1": 1}}, "unknown state 'sigma_1'"),
    ],
)
def test_what_does_not_fit_is_refused(change: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(chain(2), {"S": {"type": "shgo", "theta": 2, **change}}))


def test_outputs_that_measure_the_same_are_refused() -> None:
    plant = inline({"a": "b", "b": "-a"}, ["a", "b"])
    with pytest.raises(ConfigError, match="have one unknown input between them"):
        hgorun.simulate(experiment(plant, {"S": {"type": "shgo", "theta": 6, "extend": 1, "chains": {"a": 2, "b": 1}}}))


@pytest.mark.one_in(3)  # the family's own contract is tested elsewhere, and its numbers with this above
@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAMILIES, *OF_SAMPLES, *PUNCTUAL])
def test_every_family_keeps_the_contract_with_it(name: str) -> None:
    plants = [chain(2, "-x1 - x2 - x1**3/10"), *([] if name in ("low_power", "peaking-free") else [CONTOIS])]
    given = {key: value for key, value in block(name).items() if key != "internal"} | {"extend": 1}
    # x_2 in the equation of xi_11 is xi_12 there, not the estimate of x_2 that the law's copy of the plant takes
    skip = ["correction"] if given["type"] == "low_power" else []
    check_observer(OBSERVERS.find(given["type"]), given, plants=plants, skip=skip)
