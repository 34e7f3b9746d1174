"""Plants written out in a file: what they may look like, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest
from examples import CONTOIS, VAN_DER_POL, experiment

from hgorun.errors import ConfigError
from hgorun.plants.base import PLANTS, Parameter, units_of
from hgorun.plants.van_der_pol import VanDerPol
from hgorun.simulation.simulate import prepare

PLANT: dict[str, Any] = {
    "states": ["x1", "x2"],
    "dynamics": {"x1": "x2", "x2": "-x1"},
    "output": "x1",
    "initial": {"x1": 1, "x2": 0},
}


@pytest.mark.parametrize(
    ("output", "names"),
    [
        ("x1", ("x1",)),
        (["x1", "x1 + x2"], ("x1", "y2")),
        ("x1**2", ("y1",)),
        ({"angle": {"value": "x1", "period": 6.28}, "speed": "x2"}, ("angle", "speed")),
    ],
)
def test_an_output_has_the_name_that_it_is_given(output: Any, names: tuple[str, ...]) -> None:
    assert experiment(PLANT | {"output": output}, {}).plant.model.outputs == names


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"output": True}, "plant.output", "expected an expression, a list or name: expression, found True"),
        ({"output": []}, "plant.output", "at least one output is needed"),
        ({"output": ["x1", "x1"]}, "plant.output", "outputs must differ, found x1, x1"),
        (
            {"output": {"y": 0, "5*x1": None}},
            "plant.output.5*x1",
            "found nothing; if it is the end of a number, a decimal number is written with a point, as in 0.5*x1",
        ),
        ({"output": [0, "5*x1"]}, "plant.output", "such as x1; a decimal number is written with a point, as in 0.25"),
        ({"output": "1 + 1"}, "plant.output", "1 + 1 is a number; an output is a state or an expression of states"),
        ({"output": {"a": {"value": "2", "period": 1}}}, "plant.output.a.value", "2 is a number"),
        ({"states": ["x1", "x1"]}, "plant.states", "the name x1 is there twice"),
        ({"dynamics": {"x1": "x2"}}, "plant.dynamics", "the right-hand side of x2 is missing"),
        ({"dynamics": {"x1": "x2", "x2": "-x1", "x3": "1"}}, "plant.dynamics.x3", "unknown name 'x3'; known here: x1"),
        ({"units": {"x3": "m"}}, "plant.units.x3", "unknown name 'x3'"),
        # an equation uses what nothing declares: its unit is right
        (
            {"dynamics": {"x1": "x2", "x2": "-x1 + D"}, "units": {"D": "1/h"}},
            "plant.dynamics.x2",
            "`D` is not known. Known names: t, x1, x2, pi, e; an input is declared in plant by inputs: {D: expression "
            "of t}, a constant by parameters: {D: number}; an input that was recorded, in data by inputs: {D: column}",
        ),
        (
            {"dynamics": {"x1": "x2", "x2": "-k*x1"}, "parameters": {"k": 1}, "units": {"k": "1/h"}},
            "plant.units.k",
            "unknown name 'k'",
        ),
        (
            {"inputs": {"u": "sin(f*t)"}},
            "plant.inputs.u",
            "`f` is not known. Known names: t, u, pi, e; a constant is declared in plant by parameters: {f: number}",
        ),
        ({"inputs": {"u": "-x1"}}, "plant.inputs.u", "; feedback stands in the block controller"),
        ({"disturbance": {"x2": "a*t"}}, "plant.disturbance.x2", "declared in plant by parameters: {a: number}"),
        ({"disturbance": {"x2": "t t"}}, "plant.disturbance.x2", "an operator is missing"),
        ({"inputs": {"u": "0", "5*sin(t)": None}}, "plant.inputs.5*sin(t)", "a decimal number is written with a point"),
        ({"parameters": {"k": "4 1/s^2"}}, "plant.parameters.k", "has no unit here, so `1/s^2` is too much"),
        ({"parameters": {"g": "9.81 m/s^2"}}, "plant.parameters.g", "has no unit here, so `m` is too much"),
        ({"parameters": {"a": "b", "b": "a"}}, "plant.parameters.a", "a, b are defined in terms of each other"),
        ({"parameters": {"a": "log(-1)"}}, "plant.parameters.a", "log"),
    ],
)
def test_what_is_no_plant(changes: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(experiment(PLANT | changes, {}))
    assert words in str(caught.value)
    assert caught.value.key == key


def test_a_plant_of_the_library_takes_no_constants_of_other_names() -> None:
    with pytest.raises(ConfigError, match=r"`f` is not known\. Known names: .*e$"):
        prepare(experiment(CONTOIS | {"inputs": {"D": "f*t"}}, {}))


def test_a_parameter_without_a_default_has_to_be_given() -> None:
    class Oscillator(VanDerPol):
        known_parameters = {**VanDerPol.known_parameters, "mu": Parameter(None, "1/s", "damping")}

    with PLANTS.replaced("oscillator", Oscillator):
        plant = VAN_DER_POL | {"type": "oscillator"}
        with pytest.raises(ConfigError, match="the value of mu is missing") as caught:
            _ = experiment(plant, {}).plant
        assert caught.value.key == "plant.parameters"
        assert experiment(plant | {"parameters": {"mu": 2}}, {}).plant.parameters.size == 2


def test_units_may_be_those_of_states_outputs_and_inputs() -> None:
    block = PLANT | {
        "dynamics": {"x1": "x2", "x2": "u - x1"},
        "output": {"level": "x1", "both": "x1 + x2"},
        "inputs": {"u": "sin(t)"},
        "units": {"x1": "g/L", "u": "V", "both": "kg"},
    }
    built = experiment(block, {}).plant
    assert units_of(built.block)["level"] == "g/L"  # columns of a log are converted to it
    # an output that is a state is measured in the state's unit
    assert built.units == {"x1": "g/L", "u": "V", "both": "kg", "level": "g/L"}
    assert experiment(CONTOIS, {}).plant.units == {"D": "1/h", "x1": "g/L", "x2": "g/L"}
