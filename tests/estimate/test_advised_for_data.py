"""Observers that are named in place of one that does not take a plant: all of them run on the data, or in the loop."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, recording, signal, source

from hgorun import ConfigError, Experiment
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.observers.base import OBSERVERS
from hgorun.simulation.design import forms

HIDDEN = inline({"s": "-u*s", "v": "-v + u*s*v"}, {"y": "s*s - v - 0.1*u"}, inputs={"u": "1 + sin(t)"})
CHAIN = inline({"s": "-s + u"}, {"y": "s"}, inputs={"u": "1 + sin(t)"})
SHGO: Block = {"type": "shgo", "theta": 2}
LOW_POWER: Block = {"type": "low_power", "theta": 3, "poles": -1}
NOISE: Block = {"noise": [{"type": "gaussian", "std": 0.1}]}
TAKEN = np.arange(0, 2, 0.1)
LOG = recording(signal("y", TAKEN, np.cos(TAKEN)), u=held_input("u", TAKEN, np.sin(TAKEN)))


def config(plant: Block, observer: Block) -> dict[str, Any]:
    return {"plant": plant, "observers": {"O": observer}, "measurement": NOISE, "solver": {"step": 0.1}}


def named(error: ConfigError) -> list[str]:
    return error.message.partition("observers for this plant are ")[2].partition(";")[0].partition(" (")[0].split(", ")


@pytest.mark.costly
@pytest.mark.parametrize(("plant", "observer"), [(HIDDEN, SHGO), (CHAIN, LOW_POWER)])
def test_those_that_are_named_for_a_plant_of_data_run_on_it(plant: Block, observer: Block) -> None:
    with pytest.raises(ConfigError) as of_file:
        estimate(source(config(plant, observer)), LOG, sensitivity=False)
    names = named(of_file.value)
    assert "ekf" in names
    for name in names:
        example = OBSERVERS.find(name).example(tuple(plant["states"]))
        found = estimate(source(config(plant, {"type": name, **example})), LOG, sensitivity=False)
        assert np.all(np.isfinite(found.observers["O"].xhat))
    of_time: Block = {"time": {"end": 2.0, "output_step": 0.1}}
    sampled: Block = {"measurement": {"sampling": {"period": 0.1}, **NOISE}}
    with pytest.raises(ConfigError) as of_stream:
        Estimator(Experiment(config(plant, observer) | of_time | sampled), inputs=["u"])
    assert named(of_stream.value) == names


def test_those_that_look_back_are_named_where_there_is_a_past_to_look_at(monkeypatch: pytest.MonkeyPatch) -> None:
    few = {name: OBSERVERS.find(name) for name in ("ekf", "mhe", "predictor_chain")}
    monkeypatch.setattr(forms, "OBSERVERS", SimpleNamespace(all=lambda: few))
    of_time: Block = {"time": {"end": 2.0, "output_step": 0.1}, "measurement": {"sampling": {"period": 0.1}, **NOISE}}
    simulated = Experiment(config(CHAIN, SHGO) | of_time)
    law: Block = {"controller": {"law": {"u": "-0.1*s"}}}
    closed = Experiment(config(CHAIN | {"inputs": {"u": "controller"}}, SHGO) | of_time | law)
    cases = {
        simulated: ["ekf", "mhe", "predictor_chain"],
        simulated.with_recorded(()): ["ekf", "mhe"],
        simulated.with_recorded(["u"]): ["ekf"],
        closed: ["ekf"],
    }
    for experiment, names in cases.items():
        assert list(forms._takers(experiment.plant, experiment._around())) == names
