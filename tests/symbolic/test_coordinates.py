"""Which coordinates are taken: that depends neither on how a plant is written nor on its units."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path
from typing import Any

import examples
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS
from hgorun.result.records.observer import Coordinates
from hgorun.symbolic import ranks

NOISE = [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 20}]}]
SAMPLED = {"sampling": {"period": 0.1}, "noise": NOISE}
SHGO = {"S": {"type": "shgo", "theta": 2}}


def plant(dynamics: dict[str, str], output: Any, **more: Any) -> dict[str, Any]:
    initial = {name: 0.5 + 0.1 * i for i, name in enumerate(sorted(dynamics))}
    return {"states": list(dynamics), "dynamics": dynamics, "output": output, "initial": initial, **more}


def simulated(plant: dict[str, Any], observers: dict[str, Any] | None = None, **more: Any) -> hgorun.Result:
    experiment = examples.experiment(
        plant, observers or SHGO, **{"end": 5, "step": 0.01, "measurement": SAMPLED, **more}
    )
    return hgorun.simulate(experiment)


def by_state(result: hgorun.Result, label: str = "S") -> dict[str, np.ndarray]:
    return dict(zip(result.states, result.observers[label].xhat.T, strict=True))


def taken(result: hgorun.Result) -> Coordinates:
    found = result.observers["S"].coordinates
    assert found is not None
    return found


CHAIN = {"a": "b - 2*a", "b": "c - a*b", "c": "-a - 2*b - 2*c + sin(t)"}


@pytest.mark.costly
@pytest.mark.parametrize("block", [{"type": "shgo", "theta": 2}, {"type": "fhgo2", "theta": 2, "r": 1}])
def test_the_order_of_states_decides_nothing(block: dict[str, Any]) -> None:
    found = []
    for order in permutations(CHAIN):
        result = simulated(plant({name: CHAIN[name] for name in order}, "a"), {"S": block})
        assert taken(result) == Coordinates("chain", {"a": 3})
        found.append(by_state(result))
    for other in found[1:]:
        for name in CHAIN:
            np.testing.assert_allclose(other[name], found[0][name], rtol=1e-12, atol=1e-13)


@pytest.mark.costly
@pytest.mark.parametrize("written", ["k*(b - a)", "k**2*b - a", "b/k - a", "(b - a)*k*k"])
def test_a_parameter_that_is_one_is_the_number_one(written: str) -> None:
    number = simulated(plant({"a": "b - a", "b": "-b + cos(t)"}, "a"))
    parameter = simulated(plant({"a": written, "b": "-b + cos(t)"}, "a", parameters={"k": 1}))
    assert taken(number) == taken(parameter)
    np.testing.assert_allclose(number.observers["S"].xhat, parameter.observers["S"].xhat, rtol=1e-12)


@pytest.mark.costly
def test_a_parameter_that_is_zero_links_nothing() -> None:
    dynamics = {"a": "b + k*c", "b": "c - a", "c": "-c"}
    assert taken(simulated(plant(dynamics, "a", parameters={"k": 0}))).map == "chain"
    assert taken(simulated(plant(dynamics, "a", parameters={"k": 0.5}))).map == "derivatives"


@pytest.mark.costly
@pytest.mark.parametrize("unit", [1e-12, 1e-3, 60.0, 1e12])
def test_another_unit_of_a_state_is_not_another_observer(unit: float) -> None:
    """b in other units: b = unit B."""
    one = simulated(plant({"a": "b - a", "b": "-a*b + cos(t)"}, "a"))
    scaled = plant({"a": "k*B - a", "B": "-a*B + cos(t)/k"}, "a", parameters={"k": unit})
    scaled["initial"] = {"a": 0.5, "B": 0.6 / unit}
    two = simulated(scaled)
    assert taken(two).map == "chain"
    np.testing.assert_allclose(two.observers["S"].xhat * [1, unit], one.observers["S"].xhat, rtol=1e-9, atol=1e-12)


def test_an_output_in_other_units_is_not_another_observer() -> None:
    """Degrees Fahrenheit in place of Celsius."""
    dynamics = {"T": "q - 0.2*(T - 20)", "q": "-0.1*q"}
    found = []
    for output in ("T", "1.8*T + 32"):
        block = plant(dynamics, {"gauge": output}) | {"initial": {"T": 25, "q": 5}}
        found.append(simulated(block, {"S": SHGO["S"] | {"initial": {"T": 20}}}, measurement={}))
    np.testing.assert_allclose(found[1].observers["S"].xhat, found[0].observers["S"].xhat, rtol=1e-9)
    assert taken(found[1]) == Coordinates("chain", {"gauge": 2})


@pytest.mark.costly
def test_derivatives_can_be_chosen() -> None:
    """The gain by hand: with J = d(h, L_f h)/dx of a' = b - a the correction of b is (1 + 2) times that of a."""
    block = plant({"a": "b - a", "b": "-b + u"}, "a", inputs={"u": "cos(t)"}) | {"initial": {"a": 1, "b": 0}}
    observers = {"S": SHGO["S"] | {"map": "derivatives"}}
    result = simulated(block, observers, measurement={}, end=5, output_step=0.05, step=1e-3)
    assert taken(result) == Coordinates("derivatives", {"a": 2})
    z = np.array([1.0, 0.0, 0.0, 0.0])  # the truth, the estimate
    J, G = np.array([[1.0, 0.0], [-1.0, 1.0]]), np.array([2.0, 1.0])
    correction = 2 * np.linalg.solve(J, np.diag([1, 2]) @ G)

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        a, b, c, d = z
        x, xhat = [b - a, -b + np.cos(t)], np.array([d - c, -d + np.cos(t)])
        return np.concatenate([x, xhat - correction * (c - a)])

    t, h = 0.0, 1e-3
    for _ in range(5000):
        k1 = rate(t, z)
        k2 = rate(t + h / 2, z + h / 2 * k1)
        k3 = rate(t + h / 2, z + h / 2 * k2)
        k4 = rate(t + h, z + h * k3)
        z, t = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
    np.testing.assert_allclose(result.observers["S"].xhat[-1], z[2:], rtol=1e-9)


STRONG_AND_WEAK = {"a": "c - a", "b": "0.001*c - b", "c": "-c + sin(t)"}


@pytest.mark.costly
@pytest.mark.parametrize("outputs", [["a", "b"], ["b", "a"]])
def test_the_order_of_outputs_decides_nothing(outputs: list[str]) -> None:
    """c is seen through the strong sensor a."""
    noise = {"sampling": {"period": 0.05}, "noise": [{"type": "gaussian", "std": 0.01}]}
    result = simulated(plant(STRONG_AND_WEAK, outputs), measurement=noise, end=20)
    assert taken(result).chains == {"a": 2, "b": 1}
    assert result.metrics()["S"]["rmse"]["c"] < 0.01


def test_the_better_sensor_carries_the_chain() -> None:
    dynamics = {"a": "c - a", "b": "0.5*c - b", "c": "-c + sin(t)"}
    for std, chains in ((0.1, {"a": 1, "b": 2}), (1e-4, {"a": 2, "b": 1})):
        noise = {"outputs": {name: {"noise": [{"type": "gaussian", "std": s, "hold": 0.1}]} for name, s in
                             (("a", std), ("b", 0.01))}}  # fmt: skip
        assert taken(simulated(plant(dynamics, ["a", "b"]), measurement=noise)).chains == chains


@pytest.mark.costly
def test_of_equal_outputs_the_first_in_the_alphabet_carries_the_chain() -> None:
    dynamics = {"a": "c - a", "b": "c - b", "c": "-c + sin(t)"}
    for outputs in (["a", "b"], ["b", "a"]):
        assert taken(simulated(plant(dynamics, outputs))).chains == {"a": 2, "b": 1}


def test_chains_can_be_chosen() -> None:
    result = simulated(plant(STRONG_AND_WEAK, ["a", "b"]), {"S": SHGO["S"] | {"chains": {"b": 2, "a": 1}}})
    assert taken(result) == Coordinates("derivatives", {"a": 1, "b": 2})


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        ({"chains": {"a": 3}}, "chains", "for each output"),
        ({"chains": {"a": 1, "b": 1}}, "chains", "3 in all or more; found a: 1, b: 1"),
        ({"map": "chain"}, "map", "requires x_i' = c_i"),
        ({"type": "shgo_riccati", "map": "chain"}, "map", "coordinates of its own"),
    ],
)
def test_a_choice_that_does_not_fit_is_refused(keys: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        simulated(plant(STRONG_AND_WEAK, ["a", "b"]), {"S": SHGO["S"] | keys})
    assert error.value.key == f"observers.S.{key}"


def test_what_was_taken_is_resolved_and_gives_the_same_run() -> None:
    first = simulated(plant(STRONG_AND_WEAK, ["a", "b"]))
    again = hgorun.simulate(hgorun.Experiment(yaml.safe_load(first.config_resolved)))
    assert again.observers["S"].coordinates == first.observers["S"].coordinates
    np.testing.assert_array_equal(again.observers["S"].xhat, first.observers["S"].xhat)


def test_a_variation_keeps_what_was_taken() -> None:
    dynamics = {"a": "c - a", "b": "k*c - b", "c": "-c + sin(t)"}
    base = examples.experiment(plant(dynamics, ["a", "b"], parameters={"k": 0.5}), SHGO, end=1, step=0.01)
    assert base.coordinates["S"].chains == {"a": 2, "b": 1}
    assert base.varied({"plant.parameters.k": 2}).coordinates == base.coordinates
    assert base.varied({"measurement.noise": []}).coordinates == base.coordinates


@pytest.mark.costly
def test_files_say_what_was_taken(tmp_path: Path) -> None:
    result = simulated(plant(CHAIN, "a"))
    file = hgorun.read(result.save(tmp_path / "run.h5"))
    assert file.observers["S"].coordinates == Coordinates("chain", {"a": 3})


@pytest.mark.costly
def test_two_sensors_of_one_state_are_averaged_by_their_noise() -> None:
    """Both samples at once: the observer is that of the weighted mean."""
    dynamics = {"x": "v", "v": "-x"}
    terms = {"good": {"amplitude": 0.01, "omega": 20}, "poor": {"amplitude": 0.03, "omega": 7}}
    each = {
        name: {"sampling": {"period": 0.1}, "noise": [{"type": "sinusoids", "terms": [term]}]}
        for name, term in terms.items()
    }
    both = simulated(plant(dynamics, {"good": "x", "poor": "x"}), measurement={"outputs": each})
    assert taken(both) == Coordinates("chain", {"good": 2, "poor": 2})
    weights = {name: 1 / float(term["amplitude"]) ** 2 for name, term in terms.items()}
    mean = [t | {"amplitude": t["amplitude"] * weights[name] / sum(weights.values())} for name, t in terms.items()]
    noise = {"sampling": {"period": 0.1}, "noise": [{"type": "sinusoids", "terms": mean}]}
    single = simulated(plant(dynamics, {"mean": "x"}), measurement=noise)
    np.testing.assert_allclose(single.observers["S"].xhat, both.observers["S"].xhat, atol=1e-12)


def test_sine_and_cosine_of_an_angle_are_a_measurement_of_it() -> None:
    """The pendulum turns over; each of the two alone is blind twice a turn."""
    block = {
        "states": ["th", "om"],
        "dynamics": {"th": "om", "om": "-9.81*sin(th) - 0.1*om"},
        "output": {"s": "sin(th)", "c": "cos(th)"},
        "initial": {"th": 0, "om": 9},
    }
    for kind in ({"type": "shgo"}, {"type": "fhgo2", "r": 1}, {"type": "treangle"}):
        observers = {"S": kind | {"theta": 10, "initial": {"th": 0.2, "om": 0}}}
        result = simulated(block, observers, measurement={"sampling": {"period": 0.01}}, end=10, step=1e-3)
        assert np.max(np.abs(result.observers["S"].xhat[-1] - result.x[-1])) < 1e-6, kind


def test_more_outputs_than_states() -> None:
    result = simulated(plant({"x1": "x2", "x2": "-x1"}, ["x1", "x2", "x1 + x2"]), measurement={})
    assert taken(result).chains == {"x1": 1, "x2": 1, "y3": 1}
    assert np.max(np.abs(result.observers["S"].xhat[-1] - result.x[-1])) < 1e-3


@pytest.mark.costly
@pytest.mark.parametrize("output", [{"y": "3.2 + s - v - r*I"}, {"y": "s*s - v - r*I"}])
def test_a_refusal_names_only_observers_that_take_the_plant(output: dict[str, str]) -> None:
    block = plant({"s": "-I*s", "v": "-v + I*s*v"}, output, inputs={"I": "1 + sin(t)"}, parameters={"r": 0.1})
    with pytest.raises(ConfigError) as error:
        simulated(block, measurement={})
    names = error.value.message.partition("observers for this plant are ")[2].partition(";")[0]
    if not names:
        assert "no other observer accepts this plant" in error.value.message
    for name in names.split(", ") if names else []:
        keys = OBSERVERS.find(name).example(("s", "v"))
        simulated(block, {"S": {"type": name, **keys}}, measurement={}, end=0.1)


def test_ranks_do_not_depend_on_units() -> None:
    random = np.random.default_rng(0)
    regular = random.normal(size=(4, 4))
    singular = regular.copy()
    singular[3] = singular[0] + 2 * singular[1]
    for _ in range(20):
        rows, columns = 10.0 ** random.uniform(-12, 12, (2, 4))
        assert ranks.singular_value_ratio(rows[:, None] * regular * columns) > 1e-3
        assert ranks.singular_value_ratio(rows[:, None] * singular * columns) < ranks.SINGULAR
        assert ranks.rank(rows[:, None] * singular * columns) == 3


@pytest.mark.costly
@given(st.data(), st.integers(1, 4), st.integers(0, 1))
def test_a_short_cut_says_of_a_matrix_what_its_singular_values_say(data: st.DataObject, n: int, more: int) -> None:
    number = st.floats(-1, 1) | st.sampled_from([0.0, 1e-12, 1e9, np.nan, np.inf])
    matrix = np.array([[data.draw(number) for _ in range(n)] for _ in range(n + more)])
    if data.draw(st.booleans()):
        matrix[:, -1] = matrix[:, 0] * (1 + 1e-11 * matrix[:, -1])
    assert ranks.is_regular(matrix) == (ranks.singular_value_ratio(matrix) > ranks.SINGULAR)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("dynamics", "output", "unseen"),
    [
        ({"a": "b", "b": "-a"}, {"y": "0*b"}, ("a", "b")),
        ({"a": "b", "b": "-b"}, {"y": "b"}, ("a",)),
        ({"a": "u*b", "b": "-b"}, {"y": "a"}, ()),  # seen while the input acts
        ({"a": "b", "b": "c", "c": "-a"}, {"y": "a"}, ()),
    ],
)
def test_states_that_no_measurement_depends_on(
    dynamics: dict[str, str], output: dict[str, str], unseen: tuple[str, ...]
) -> None:
    block = plant(dynamics, output, inputs={"u": "1"} if "u*b" in dynamics.values() else {})
    noise = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}
    result = simulated(block, {"E": {"type": "ekf", "Q": {"b": 0.1}}}, measurement=noise, end=0.5)
    told = [f"observer E: nothing that is measured depends on {', '.join(unseen)}: samples cannot tell errors there"]
    assert list(result.remarks) == (told if unseen else [])
    if unseen:
        with pytest.raises(ConfigError, match=f"depends on the state {', '.join(unseen)}, now or later") as refused:
            simulated(block, {"S": {"type": "shgo", "theta": 2}}, measurement=noise, end=0.5)
        assert "kinetic_rate" not in refused.value.message


def test_a_refusal_names_few_observers() -> None:
    with pytest.raises(ConfigError, match=r"are shgo, .*; \d+ more of hgorun list observers take it") as refused:
        simulated(plant({"a": "b", "b": "-sin(a)"}, {"y": "a"}), {"L": {"type": "luenberger_exact", "poles": -1}})
    assert len(refused.value.message) < 350
