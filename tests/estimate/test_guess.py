"""The guess at which equations have to be defined where nothing is simulated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from examples import inline
from recordings import recording, signal, source

from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.start import starting
from hgorun.estimate.start.guess import guessed
from hgorun.simulation.experiment.experiment import Experiment

TIMES = np.linspace(0.0, 0.5, 11)
DILUTED = {"c": "-0.2*c/V", "V": "0"}
FILTER = {"type": "ekf", "Q": {"c": 0.1}}


def built(count: Any, initial: dict[str, float] | None = None, **observers: Any) -> Experiment:
    """A vessel that is diluted, its volume measured by nothing."""
    plant: dict[str, Any] = {key: value for key, value in inline(DILUTED, "c").items() if key != "initial"}
    if initial is not None:
        plant["initial"] = initial
    config = {"plant": plant, "observers": observers, "solver": {"step": 0.01}}
    measured = recording(signal("c", TIMES, 3 * np.exp(-0.1 * TIMES), std=0.01))
    return completed(source(config), replace(measured, first_samples=count), "vessel", "")


def test_a_start_is_fitted_where_an_observer_begins_with_what_is_not_measured() -> None:
    """At V = 0 the model has no numbers; with V = 2 it is 3 exp(-t/10)."""
    found = built(3, E={**FILTER, "initial": {"V": 2}}).observers["E"].initial
    assert found == pytest.approx({"c": 3.0, "V": 2.0}, rel=1e-6)


def test_a_start_is_fitted_where_the_plant_begins_with_what_is_not_measured() -> None:
    found = built(3, {"V": 2}, E=FILTER).observers["E"].initial
    assert found == pytest.approx({"c": 3.0, "V": 2.0}, rel=1e-6)


def test_a_fit_that_has_no_guess_says_from_where_it_was_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(starting, "fit_of", lambda *_: None)
    with pytest.raises(ConfigError) as error:
        built(3, {"V": 2}, E=FILTER)
    assert error.value.message.endswith("it is followed from near c = 0, V = 2: plant.initial says another guess")


def test_what_observers_begin_with_alike_is_the_guess() -> None:
    one, other = {"initial": {"c": 1.0, "V": 2}}, {"initial": {"c": 2.0, "V": 2.0}}
    given: dict[str, Any] = {"plant": {}, "observers": {"a": one, "b": other, "c": {}, "d": None, "e": {"initial": 3}}}
    assert guessed(given, ("c", "V", "S")) == {"c": 0.0, "V": 2.0, "S": 0.0}
    assert guessed({**given, "plant": {"initial": {"V": 5}}}, ("V",)) == {"V": 5}
    assert guessed({"plant": {}}, ("V",)) == {"V": 0.0}


@pytest.mark.parametrize(("values", "guess"), [(["1/2"], 0.5), (["4/2", 2], 2.0), (["4/2", 3], 0.0), (["x"], 0.0)])
def test_a_guess_may_be_an_expression_of_numbers(values: list[str | int], guess: float) -> None:
    observers = {f"o{k}": {"initial": {"V": value}} for k, value in enumerate(values)}
    assert guessed({"plant": {}, "observers": observers}, ["V"]) == {"V": guess}
