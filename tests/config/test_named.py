"""Mappings by names: one that is not there is told with those that are, and all else is as of a dictionary."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from examples import experiment, inline

import hgorun
from hgorun.config.named import Named, UnknownName
from hgorun.config.nearest import listed

OSCILLATOR = inline({"a": "b", "b": "-a"}, "a")


@pytest.fixture(scope="module")
def result() -> hgorun.Result:
    return hgorun.simulate(experiment(OSCILLATOR, {"SHGO": {"type": "shgo", "theta": 2}}, end=1.0, step=0.1))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (lambda r: r.metrics()["shgo"], "no observer is called 'shgo'. Did you mean `SHGO`? Known: SHGO"),
        (lambda r: r.metrics()["SHGO"]["rms"], "no metric is called 'rms'. Did you mean `rmse`? Known: rmse, sup, "),
        (lambda r: r.metrics()["SHGO"]["rmse"]["x1"], "no state is called 'x1'. Known: a, b"),
        (lambda r: r.observers[0], "no observer is called 0. Known: SHGO"),
        (lambda r: r.observers["SHGO"].gains["tetha"], "no gain is called 'tetha'. Did you mean `theta`?"),
        (lambda r: r.observers["SHGO"].internal["eta"], "no internal state is called 'eta'. Known: none"),
        (lambda r: r.integration_error["S"], "no observer (or plant) is called 'S'. Known: plant, SHGO"),
        (lambda r: r.closed_loop["SHGO"], "no observer with a controller is called 'SHGO'. Known: none"),
    ],
)
def test_names_of_a_result(result: hgorun.Result, asked: Callable[[Any], object], said: str) -> None:
    with pytest.raises(KeyError) as error:
        asked(result)
    assert str(error.value).startswith(said)


def test_names_of_an_experiment_and_of_a_sweep() -> None:
    one = experiment(OSCILLATOR, {"SHGO": {"type": "shgo", "theta": 2}}, end=1.0, step=0.1)
    found = hgorun.sweep(one, {"observers.SHGO.theta": [2, 3]})
    for mapping, name, said in (
        (one.observers, "S", "no observer is called 'S'"),
        (found.metrics, "rms", "no metric is called 'rms'. Did you mean `rmse`?"),
        (found.axes, "theta", "no axis is called 'theta'. Known: observers.SHGO.theta"),
    ):
        with pytest.raises(UnknownName) as error:
            mapping[name]
        assert str(error.value).startswith(said)


def test_of_many_names_the_nearest_are_listed() -> None:
    names: Mapping[str, int] = {f"n{k}": k for k in range(43)}
    with pytest.raises(UnknownName, match=r"Known: n0, .*, n11 and 31 more$"):
        Named(names, "number")["zz"]
    with pytest.raises(UnknownName, match=r"Known: n42, n2, .* and 31 more$"):
        Named(names, "number")["n42b"]


def test_a_list_is_cut_and_says_where_all_are() -> None:
    assert listed([]) == "none"
    assert listed(range(12)) == ", ".join(map(str, range(12)))
    assert listed(range(14), see="hgorun list x") == f"{listed(range(12))} and 2 more, see `hgorun list x`"
    assert listed([f"n{k}" for k in range(20)], "N19").startswith("n19, n1, n9, ")


@pytest.mark.parametrize("again", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy, copy.deepcopy])
def test_all_else_is_a_dictionary(again: Callable[[Any], Any]) -> None:
    one = Named({"a": np.float64(1), "b": np.float64(2)}, "number")
    found = again(one)
    assert (found == one, found == {"a": 1, "b": 2}, found.get("c"), "c" in found) == (True, True, None, False)
    with pytest.raises(UnknownName, match="no number is called 'c'"):
        found["c"]
