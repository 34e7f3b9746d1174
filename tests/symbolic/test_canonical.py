"""The coordinates that the program derives, against those that the papers derive by hand."""

from __future__ import annotations

from typing import Any

import casadi as ca
import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.matrices import A, C, hurwitz_gain, inv_Delta
from hgorun.symbolic.uniform import input_slopes

MEASURED = {"sampling": {"period": 0.1}, "noise": [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 20}]}]}


def experiment(plant: dict[str, Any], observers: dict[str, Any], **more: Any) -> hgorun.Experiment:
    return examples.experiment(plant, observers, **{"end": 2, "step": 0.01, "measurement": MEASURED, **more})


def form_of(e: hgorun.Experiment) -> CanonicalForm:
    form = next(iter(e.forms.values()))
    assert isinstance(form, CanonicalForm)
    return form


def inline(states: str, dynamics: dict[str, str], output: Any, **more: Any) -> dict[str, Any]:
    names = states.split()
    initial = {name: 0.5 + 0.1 * i for i, name in enumerate(names)}
    return {"states": names, "dynamics": dynamics, "output": output, "initial": initial, **more}


CONTOIS = {
    "type": "contois", "inputs": {"D": "mu*(1 - abs(sin(t))/2)"}, "initial": {"x1": 1.5, "x2": 15},
}  # fmt: skip
CONTOIS_INLINE = inline(
    "x1 x2",
    {"x1": "mu*x1*x2/(k_c*x1 + x2) - D*x1", "x2": "-mu*x1*x2/(k_c*x1 + x2) + D*(s_in - x2)"},
    "x1",
    parameters={"mu": 1.064, "k_c": 4.39, "s_in": 20},
    inputs={"D": "mu*(1 - abs(sin(t))/2)"},
) | {"initial": {"x1": 1.5, "x2": 15}}
SHGO = {"SHGO": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}}}


@pytest.mark.parametrize("plant", [CONTOIS, CONTOIS_INLINE], ids=["built-in", "inline"])
def test_jacobian_of_the_bioreactor_is_the_thesis_one(plant: dict[str, Any]) -> None:
    """(3.140): the map is taken with the dilution at zero, so D appears nowhere in it."""
    e = experiment(plant, SHGO)
    mu, k_c = 1.064, 4.39
    for x1, x2 in np.random.default_rng(0).uniform(0.5, 15, (5, 2)):
        denominator = (k_c * x1 + x2) ** 2
        expected = [[1, 0], [mu * x2**2 / denominator, mu * k_c * x1**2 / denominator]]
        found = form_of(e).J(ca.DM([x1, x2]), ca.DM(e.plant.parameters))
        np.testing.assert_allclose(np.asarray(found), expected, rtol=1e-12)


def test_inverse_map_of_the_bioreactor() -> None:
    e = experiment(CONTOIS, SHGO)
    inverse = e.plant.model.inverse
    assert inverse is not None
    for x in np.random.default_rng(1).uniform(0.5, 15, (5, 2)):
        z = form_of(e).Phi(ca.DM(x), ca.DM(e.plant.parameters))
        np.testing.assert_allclose(np.asarray(inverse(z, ca.DM(e.plant.parameters))).ravel(), x, rtol=1e-12)


def test_a_model_written_out_runs_as_the_built_in_one() -> None:
    one, two = (hgorun.simulate(experiment(p, SHGO)) for p in (CONTOIS, CONTOIS_INLINE))
    np.testing.assert_allclose(one.observers["SHGO"].xhat, two.observers["SHGO"].xhat, rtol=1e-13)


def test_chains_stay_as_they_are() -> None:
    e = experiment(
        inline("a b c", {"a": "b - a**2", "b": "c + sin(a*b)", "c": "-a*b*c + cos(t)"}, "a"),
        {"o": {"type": "shgo", "theta": 2}},
    )
    assert form_of(e).identity


def test_a_scaled_chain_gets_its_map() -> None:
    e = experiment(inline("a b", {"a": "2*b", "b": "-a"}, "a"), {"o": {"type": "shgo", "theta": 2}})
    assert not form_of(e).identity
    np.testing.assert_array_equal(np.asarray(form_of(e).J(ca.DM([1, 1]), ca.DM(0, 1))), [[1, 0], [0, 2]])


def test_states_in_another_order_are_no_obstacle() -> None:
    """The chain b -> a with its states listed backwards: the map is a permutation."""
    one = hgorun.simulate(experiment(inline("a b", {"a": "b", "b": "-a"}, "a"), {"o": {"type": "shgo", "theta": 2}}))
    swapped = inline("b a", {"a": "b", "b": "-a"}, "a") | {"initial": {"a": 0.5, "b": 0.6}}
    two = hgorun.simulate(experiment(swapped, {"o": {"type": "shgo", "theta": 2}}))
    np.testing.assert_allclose(one.observers["o"].xhat, two.observers["o"].xhat[:, ::-1], atol=1e-14)


@pytest.mark.costly
@pytest.mark.parametrize("block", [{"type": "shgo", "theta": 2}, {"type": "fhgo2", "theta": 2, "r": 2}])
def test_two_outputs_that_do_not_meet_are_two_single_ones(block: dict[str, Any]) -> None:
    first, second = {"a": "b - 0.3*a", "b": "-a - 0.1*a**3"}, {"c": "d - 0.2*c**2", "d": "-2*sin(c)"}
    both = experiment(inline("a b c d", first | second, ["a", "c"]), {"o": block})
    together = hgorun.simulate(both)
    for states, dynamics, columns in (("a b", first, slice(0, 2)), ("c d", second, slice(2, 4))):
        plant = inline(states, dynamics, states[0])
        plant["initial"] = {s: {"a": 0.5, "b": 0.6, "c": 0.7, "d": 0.8}[s] for s in plant["states"]}
        alone = hgorun.simulate(experiment(plant, {"o": block}))
        np.testing.assert_allclose(together.observers["o"].xhat[:, columns], alone.observers["o"].xhat, atol=1e-13)


@pytest.mark.costly
@pytest.mark.parametrize("delay", [0, 0.05])
def test_two_outputs_with_their_own_schedules(delay: float) -> None:
    """Each output keeps its own samples, also with other rates: again two single observers."""
    first, second = {"a": "b", "b": "-a"}, {"c": "d", "d": "-2*c"}
    schedules = {"a": {"sampling": {"period": 0.1}, "delay": delay}, "c": {"sampling": {"period": 0.16}}}
    both = experiment(
        inline("a b c d", first | second, ["a", "c"]),
        {"o": {"type": "fhgo2", "theta": 2, "r": 1}},
        measurement={"outputs": schedules},
    )
    together = hgorun.simulate(both)
    for states, dynamics, columns in (("a b", first, slice(0, 2)), ("c d", second, slice(2, 4))):
        plant = inline(states, dynamics, states[0])
        plant["initial"] = {s: {"a": 0.5, "b": 0.6, "c": 0.7, "d": 0.8}[s] for s in plant["states"]}
        alone = hgorun.simulate(
            experiment(plant, {"o": {"type": "fhgo2", "theta": 2, "r": 1}}, measurement=schedules[states[0]])
        )
        np.testing.assert_allclose(together.observers["o"].xhat[:, columns], alone.observers["o"].xhat, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (inline("x1 x2", {"x1": "-x1", "x2": "-x2"}, "x1"), r"\(x1\) depends on the state x2"),
        (inline("x1 x2", {"x1": "-x1 + u*x2", "x2": "-x2"}, "x1", inputs={"u": "1"}), "x2 does not appear"),
        (inline("x1 x2 x3", {"x1": "x2 + x3", "x2": "-x2", "x3": "-x3"}, "x1"), "singular Jacobian everywhere"),
        (inline("x1 x2", {"x1": "x2*(1 + u)", "x2": "-x1"}, "x1", inputs={"u": "sin(t)"}), "not uniformly observable"),
        (inline("x1 x2", {"x1": "x2*(2 + sin(t))", "x2": "-x1"}, "x1"), "depends on time"),
    ],
)
def test_a_plant_outside_the_class_is_refused_with_the_reason(plant: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        hgorun.simulate(experiment(plant, {"o": {"type": "shgo", "theta": 2}}))
    assert error.value.key == "plant"


def test_without_observers_any_plant_runs() -> None:
    result = hgorun.simulate(experiment(inline("x1 x2", {"x1": "-x1", "x2": "-x2"}, "x1"), {}))
    np.testing.assert_allclose(result.x[:, 0], 0.5 * np.exp(-result.time), rtol=1e-9)


def test_hurwitz_gain_places_the_poles() -> None:
    for poles in (-1, [-1, -2, -3], [complex(-1, 2), complex(-1, -2), -4]):
        K = hurwitz_gain(3, poles)
        closed = np.asarray(A(3)) - np.outer(K, np.asarray(C(3)))
        expected = np.poly(np.full(3, poles) if np.ndim(poles) == 0 else poles)
        np.testing.assert_allclose(np.poly(closed), np.real(expected), atol=1e-12)
    np.testing.assert_array_equal(hurwitz_gain(4, -1), [4, 6, 4, 1])


def test_inverse_of_delta() -> None:
    theta = ca.SX.sym("theta")
    value = ca.Function("f", [theta], [inv_Delta(theta, 3)])(2.0)
    np.testing.assert_array_equal(np.asarray(value), np.diag([1, 2, 4]))


@pytest.mark.costly
@pytest.mark.parametrize("states", ["a b c d", "a c b d", "d c b a"])
def test_saturation_does_not_depend_on_the_order_of_the_states(states: str) -> None:
    """F leads from the measured states to the others, wherever they stand in the list."""
    dynamics = {"a": "b", "b": "-a - 0.1*a**3", "c": "d", "d": "-2*sin(c)"}
    observers = {"o": {"type": "shgo", "theta": 3, "saturation": {"b": [-0.2, 0.2], "d": [-0.2, 0.2]}}}

    def estimates(order: str) -> dict[str, np.ndarray]:
        plant = inline(order, dynamics, ["a", "c"])
        plant["initial"] = {"a": 0.5, "b": 0.6, "c": 0.7, "d": 0.8}
        xhat = hgorun.simulate(experiment(plant, observers)).observers["o"].xhat
        return dict(zip(order.split(), xhat.T, strict=True))

    expected = estimates("a b c d")
    assert np.max(np.abs(expected["b"])) > 0.25  # saturation is at work
    for name, values in estimates(states).items():
        np.testing.assert_allclose(values, expected[name], atol=1e-12)


def test_adaptive_steps_end_at_time_zero() -> None:
    """The smallest step is measured by the larger end of a segment, so it is never zero."""
    plant = inline("x1", {"x1": "-1 + 1.0e-30*sqrt(x1)"}, "x1")
    config = {"time": {"start": -2, "end": 0, "output_step": 0.1}, "solver": {"method": "dopri5", "rtol": 1e-8}}
    with pytest.raises(hgorun.SimulationError, match=r"beyond t = -1\.5: sqrt of a negative number"):
        hgorun.simulate(experiment(plant, {}, measurement={}, **config))


@pytest.mark.slow
def test_an_observer_that_asks_for_hopeless_steps_does_not_stop_the_others() -> None:
    """Unstable gains make it grow and get stiff: it counts as diverged, the run ends."""
    observers = {"S": {"type": "shgo", "theta": 2}, "B": {"type": "shgo", "theta": 2, "gains": [-2, 1]}}
    plant = {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}}
    config = {"time": {"end": 20, "output_step": 0.1}, "solver": {"method": "dopri5", "rtol": 1e-6}}
    together = hgorun.simulate(experiment(plant, observers, measurement={}, **config))
    assert together.observers["B"].diverged_at is not None
    assert together.observers["S"].status == "ok"
    assert together.metrics()["S"]["rmse"]["x2"] < 1e-5


@pytest.mark.parametrize(
    ("dynamics", "more"),
    [
        ({"x1": "2*x2", "x2": "-sin(x1)"}, {"map": "derivatives"}),
        ({"x1": "x2 + x2**3", "x2": "-sin(x1)"}, {}),
        ({"x1": "x2 + x2**3", "x2": "-sin(x1)"}, {"saturation": {"x2": [-5, 5]}}),
    ],
)
@pytest.mark.parametrize("kind", ["shgo", "fhgo2", "treangle", "low_power"])
def test_canonical_coordinates_need_an_inverse(kind: str, dynamics: dict[str, str], more: dict[str, Any]) -> None:
    block = {"type": kind, "theta": 2, "coordinates": "canonical", **more}
    plant = {"states": ["x1", "x2"], "dynamics": dynamics, "output": "x1", "initial": {"x1": 1, "x2": 0.5}}
    with pytest.raises(hgorun.ConfigError, match="gives no inverse of its canonical map") as error:
        hgorun.simulate(experiment(plant, {"O": block}))
    assert error.value.key == "observers.O.coordinates"


@pytest.mark.parametrize(
    ("dynamics", "output", "always"),
    [
        ({"a": "b + u*a*k", "b": "-a*b + u*b"}, "a", True),
        ({"b": "-a*b + u*b", "a": "b + u*a*k"}, "a", True),
        ({"a": "b + u*a*k", "b": "-a*b + u*b"}, "a + a*a", True),
        ({"a": "b + u*b*k", "b": "-a + u*b"}, "a", False),
        ({"a": "b + k*a", "b": "-a + u"}, "a + 0.1*b", False),
    ],
)
def test_what_is_triangular_for_all_numbers_is_known_from_the_equations(
    dynamics: dict[str, str], output: str, always: bool
) -> None:
    for k in (0.0, 1.5):  # b reaches a' through the input, unless k is zero
        plant = inline(" ".join(dynamics), dynamics, output, inputs={"u": "sin(t)"}, parameters={"k": k})
        plant["initial"] = {"a": 0.4, "b": 0.7}
        e = experiment(plant, {"o": {"type": "shgo", "theta": 2, "map": "derivatives"}})
        if "u*b*k" in dynamics["a"] and k:
            with pytest.raises(ConfigError, match="not uniformly observable"):
                _ = e.forms
        else:
            assert (input_slopes(form_of(e)) is None) == always
