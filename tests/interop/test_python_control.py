"""Plants from python-control and observers for it, against its own simulations."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np
import pytest

import hgorun
from hgorun import ConfigError
from hgorun.interop.control import observer, plant

TIME = np.linspace(0, 2, 11)
FINE = {"rtol": 1e-8, "atol": 1e-10}


def response(system: Any, start: Any, u: float = 0.5) -> Any:
    """Theirs, with a constant input."""
    given = np.full(TIME.size, u)
    return control.input_output_response(system, TIME, given, start, solve_ivp_kwargs=FINE)


def simulated(block: dict[str, Any], observers: dict[str, Any] | None = None) -> hgorun.Result:
    config = {"time": {"end": 2, "output_step": 0.2}, "plant": block, "observers": observers or {}}
    return hgorun.simulate(config | {"solver": {"method": "dopri5", "step": 0.005}})


def pendulum(t: Any, x: Any, u: Any, params: Any) -> Any:
    return np.array([x[1], -params["g"] * np.sin(x[0]) - 0.2 * x[1] + np.exp(-t) * u[0]])


NONLINEAR = control.nlsys(
    pendulum, lambda t, x, u, params: x[0], inputs=["torque"], outputs=["angle"], states=["angle", "speed"],
    params={"g": 9.81}, name="pendulum",
)  # fmt: skip
LINEAR = control.ss(
    [[-0.1, 1.0, 0.0], [1 / 3, -0.5, 2.0], [0.0, -1.0, -0.7]], [[0.0], [1.0], [0.3]], [[1.0, 0.0, 0.0]], [[0.0]]
)


def test_a_linear_system_is_its_matrices() -> None:
    block = plant(LINEAR, inputs={"u0": "0.5"}, initial={"x0": 1, "x1": -1})
    assert block["states"] == ["x0", "x1", "x2"]
    experiment = hgorun.Experiment({"time": {"end": 1, "output_step": 0.1}, "plant": block, "observers": {}})
    model = experiment.plant.model
    import casadi as ca

    jacobian = ca.Function("J", [model.t, model.x, model.u, model.p], [ca.jacobian(model.dynamics, model.x)])
    assert np.array_equal(np.asarray(jacobian(0, [1, 2, 3], [4], [])), LINEAR.A)  # the last bit of 1/3, too
    found = response(LINEAR, [1, -1, 0])
    np.testing.assert_allclose(simulated(block).x, found.states.T, rtol=1e-6, atol=1e-7)


def test_a_nonlinear_system_is_followed_by_symbols() -> None:
    block = plant(NONLINEAR, inputs={"torque": 0.5}, initial={"angle": 1}, outputs=["phi"])
    assert block["parameters"] == {"g": 9.81}
    assert block["output"] == {"phi": "angle"}
    found = response(NONLINEAR, [1, 0])
    np.testing.assert_allclose(simulated(block).x, found.states.T, rtol=1e-6, atol=1e-6)


@pytest.mark.measured
@pytest.mark.costly
@pytest.mark.parametrize("initial", [{"x[0]": 1, "x2": 3}, {"x0": 1, "x[2]": 3}, [1, 0, 3], np.array([1.0, 0.0, 3.0])])
@pytest.mark.parametrize("inputs", [{"u[0]": "sin(t)"}, {"u0": "sin(t)"}, ["sin(t)"]])
def test_values_are_given_by_their_names_by_ours_or_in_order(initial: Any, inputs: Any) -> None:
    block = plant(LINEAR, inputs=inputs, initial=initial)
    assert block["initial"] == {"x0": 1, "x1": 0, "x2": 3}
    assert block["inputs"] == {"u0": "sin(t)"}
    named = plant(LINEAR, initial={"x[1]": 2}, states=["a", "b", "c"])
    assert named["initial"] == {"a": 0, "b": 2, "c": 0}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"initial": [1, 2]}, "initial: expected a mapping of names, or a list with .* x0, x1, x2; found 2 of them"),
        ({"initial": 3.0}, "initial: .* found 3.0"),
        ({"inputs": "sin"}, "inputs: .* for each of u0; found 'sin'"),
    ],
)
def test_values_that_are_of_no_name(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        plant(LINEAR, **options)


def test_an_observer_is_a_system_of_theirs() -> None:
    """The plant of theirs and the observer of ours, connected and simulated by them, against our own run."""
    block = plant(NONLINEAR, inputs={"torque": 0.5}, initial={"angle": 1})
    observers = {"FHGO": {"type": "fhgo2", "theta": 4, "r": 1, "initial": {"angle": 0.2}}}
    config = {"time": {"end": 5, "output_step": 0.02}, "plant": block, "observers": observers}
    system, start = observer(hgorun.Experiment(config), "FHGO")
    assert list(system.output_labels) == ["angle_hat", "speed_hat"]
    whole = control.interconnect([NONLINEAR, system], inputs=["torque"], outputs=["angle_hat", "speed_hat"])
    found = response(whole, [1, 0, *start])
    ours = simulated(block, observers).observers["FHGO"].xhat
    np.testing.assert_allclose(found.outputs.T, ours, rtol=1e-5, atol=1e-6)


def branching(t: Any, x: Any, u: Any, params: Any) -> Any:
    return [x[1] if x[0] > 0 else -x[1], -x[0]]


def of_math(t: Any, x: Any, u: Any, params: Any) -> Any:
    return [x[1], -math.sin(x[0])]


def undriven(t: Any, x: Any, u: Any, params: Any) -> Any:
    return [x[1], -x[0]]


def by_type(t: Any, x: Any, u: Any, params: Any) -> Any:
    return [x[1], -x[0] if isinstance(x[0], float) else -2 * x[0]]


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (branching, "cannot be followed by symbols in line"),
        (of_math, "turns symbols into numbers, as math.sin"),
        (by_type, "gives other numbers than its symbols"),
        (lambda t, x, u, p: [x[1]], "gives 1 numbers for 2"),
        (lambda t, x, u, p: [x[1], sum(np.sin((k + 1) * x[0]) for k in range(500))], "more than 2,000 characters"),
    ],
)
def test_what_cannot_be_followed_says_why(function: Any, words: str) -> None:
    system = control.nlsys(function, None, inputs=0, outputs=2, states=2, name="odd")
    with pytest.raises(ConfigError, match=words):
        plant(system)


@pytest.mark.parametrize(
    ("system", "options", "words"),
    [
        (control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), {}, "discrete"),
        (control.tf([1], [1, 1]), {}, "a TransferFunction has no states: control.ss makes a StateSpace of it"),
        (control.frd([1, 2], [1, 2]), {}, "expected a StateSpace or .*, found FrequencyResponseData$"),
        (LINEAR, {"states": ["a"]}, "3 of them, found 1"),
        (control.nlsys(undriven, inputs=0, outputs=2, states=2), {"inputs": {"u": 1}}, "has no inputs"),
    ],
)
def test_what_is_no_plant(system: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        plant(system, **options)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"initial": {"angel": 1}}, "initial: unknown name 'angel'; known here: angle, speed. Did you mean `angle`?"),
        ({"initial": {"angle": 1, "x[5]": 1}}, "initial: unknown name 'x[5]'; known here: angle, speed"),
        ({"inputs": {"torqe": 0}}, "inputs: unknown name 'torqe'; known here: torque. Did you mean `torque`?"),
    ],
)
def test_names_that_the_system_does_not_have(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        plant(NONLINEAR, **given)
    assert str(caught.value) == words


SAMPLED = {"sampling": {"period": 0.1}}


@pytest.mark.parametrize(
    ("kind", "measurement", "words"),
    [
        (
            {"type": "ekf", "Q": {"angle": 1, "speed": 1}},
            SAMPLED,
            "not a differential equation alone",
        ),
        ({"type": "shgo", "theta": 3}, SAMPLED, "sampled or late"),
    ],
)
def test_observers_that_are_no_system(kind: dict[str, Any], measurement: dict[str, Any], words: str) -> None:
    noise = {"noise": [{"type": "gaussian", "std": 0.1}]}
    config = {"time": {"end": 1, "output_step": 0.1}, "plant": plant(NONLINEAR, inputs={"torque": 0})}
    experiment = hgorun.Experiment(config | {"observers": {"o": kind}, "measurement": measurement | noise})
    with pytest.raises(ConfigError, match=words):
        observer(experiment, "o")
    with pytest.raises(ConfigError, match="Known: o"):
        observer(experiment, "p")
