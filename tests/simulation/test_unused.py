"""A parameter of a plant written in place that nothing uses is refused; whatever may use it counts."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from examples import Block, experiment, inline
from shell import Shell

from hgorun.errors import ConfigError
from hgorun.observers.kinetic_rate import KineticRateObserver
from hgorun.plants.inline import InlinePlant
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.experiment.unused import refuse_unused_changes

SHGO = {"SHGO": {"type": "shgo", "theta": 2}}
FILE = """
time: {end: 0.5, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: "-l*x1 + u"}
  output: x1
  parameters: {l: 2, amplitude: 1}
  inputs: {u: amplitude*sin(t)}
  initial: {x1: 1, x2: 0}
observers:
  SHGO: {type: shgo, theta: 2}
solver: {step: 0.01}
"""


def oscillator(**parameters: float) -> Block:
    return inline({"x1": "x2", "x2": "-l*x1"}, "x1", parameters={"l": 2, **parameters})


def test_what_nothing_uses_is_refused_with_what_was_meant() -> None:
    with pytest.raises(ConfigError, match=r"plant\.parameters\.L: nothing uses the parameter 'L'\. Did you mean `l`\?"):
        experiment(oscillator(L=3), SHGO)
    one = experiment(oscillator(), SHGO)
    with pytest.raises(ConfigError, match=r"nothing uses the parameter 'L'\. Did you mean `l`\?"):
        one.varied({"plant.parameters.L": 3})
    assert one.varied({"plant.parameters.l": 3}).plant.parameters.tolist() == [3]


@pytest.mark.parametrize("plant", ["integrator_chain", "lee_second_order"])
def test_a_built_in_plant_without_parameters_of_its_own_refuses_what_nothing_uses(plant: str) -> None:
    block: Block = {"type": plant, "initial": {"x1": 1, "x2": 0}, "parameters": {"a": 2, "b": 3}}
    block["disturbance"] = {"x2": "a*sin(t)"}
    with pytest.raises(ConfigError, match=r"plant\.parameters\.b: nothing uses the parameter 'b'"):
        experiment(block, SHGO)
    assert experiment({**block, "parameters": {"a": 2}}, SHGO).plant.parameters.tolist() == [2]


@pytest.mark.parametrize(
    "more",
    [
        {"parameters": {"l": "2*a", "a": 3}},
        {"parameters": {"l": 2, "a": 3}, "inputs": {"u": "a*t"}},
        {"parameters": {"l": 2, "a": 3}, "disturbance": {"x2": "a*sin(t)"}},
        {"parameters": {"l": 2, "a": 3}, "output": {"y": "x1 + a*x2**3"}},
        {"parameters": {"l": 2, "a": 3}, "output": {"y": {"value": "a*x1", "period": 10}}},
    ],
)
def test_other_parameters_inputs_disturbance_and_outputs_use_them(more: Block) -> None:
    found = experiment(inline({"x1": "x2", "x2": "-l*x1"}, **{"output": "x1", **more}), SHGO)
    assert found.varied({"plant.parameters.a": 4}).plant_block.parameters["a"] == "4.0"


def test_observers_use_them() -> None:
    plant = oscillator(D=0.1)
    with pytest.raises(ConfigError, match="'D'"):
        experiment(plant, SHGO)
    block = InlinePlant.model_validate(plant)
    rates = {"type": "kinetic_rate", "theta": 2, "yields": {"x1": [1]}, "dilution": "D"}
    refuse_unused_changes([("plant",)], block, {"K": KineticRateObserver.model_validate(rates)}, None)


@pytest.mark.slow
@pytest.mark.measured
def test_set_is_refused_and_an_overridden_use_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    (tmp_path / "c.yaml").write_text(FILE)
    (tmp_path / "still.yaml").write_text("extends: c.yaml\nplant: {inputs: {u: 0}}\n")
    (tmp_path / "mistyped.yaml").write_text("extends: c.yaml\nplant: {parameters: {L: 3}}\n")
    (tmp_path / "runs.yaml").write_text(FILE + "runs:\n  a: {}\n  b:\n    plant: {inputs: {u: 0}}\n")
    (tmp_path / "wrong.yaml").write_text(FILE + "runs:\n  a: {}\n  b:\n    plant: {parameters: {L: 0}}\n")
    refused = "nothing uses the parameter 'L'. Did you mean `l`?"
    assert shell("simulate", "c.yaml", "--set", "plant.parameters.L=3")[::2] == (
        2, f"hgorun: --set plant.parameters.L=3: plant.parameters.L: {refused}\n",
    )  # fmt: skip
    assert shell("simulate", "mistyped.yaml")[::2] == (2, f"hgorun: mistyped.yaml:2: plant.parameters.L: {refused}\n")
    code, _, err = shell("simulate", "wrong.yaml")
    assert (code, refused in err) == (2, True)
    assert shell("simulate", "runs.yaml")[::2] == (0, "")
    assert shell("simulate", "c.yaml", "--set", "plant.inputs.u=0", "-o", "still.h5")[::2] == (0, "")
    assert shell("rerun", "still.h5", "--check")[::2] == (0, "")
    assert shell("simulate", "still.yaml")[::2] == (0, "")
    (tmp_path / "s.yaml").write_text("base: still.yaml\naxes: {plant.parameters.l: [1, 2]}\n")
    assert shell("sweep", "s.yaml")[::2] == (0, "")
    (tmp_path / "s.yaml").write_text("base: c.yaml\naxes: {plant.parameters.L: [1, 2]}\n")
    assert shell("sweep", "s.yaml")[::2] == (2, f"hgorun: s.yaml:2: axes.plant.parameters.L: {refused}\n")


def test_an_axis_of_inputs_may_leave_parameters_unused() -> None:
    one = Experiment(yaml.safe_load(FILE))
    assert one.varied({"plant.inputs.u": "0"}).plant_block.inputs == {"u": "0"}
