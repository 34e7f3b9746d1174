"""Laws of the coordinates: the way there and back, and what is refused with which reason."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import Block, experiment, inline

from hgorun.errors import NotObservableForm
from hgorun.symbolic.derivatives import derivative_form
from hgorun.symbolic.lower_triangular import lower_triangular_form, state_affine_form
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.reconstruction import Jets, input_derivatives, output_derivatives, reconstruction
from hgorun.symbolic.strict_feedback import strict_feedback_form


def model_of(block: Block) -> PlantModel:
    return experiment(block, {}).plant.model


def numbers(value: Any) -> np.ndarray:
    return np.asarray(ca.DM(value).full()).ravel()


AFFINE = inline({"a": "2*b - sin(a)", "b": "(1 + a**2)*c + a*b", "c": "-a*c"}, "a")
BENT = inline({"a": "b + 0.2*b**3", "b": "c + 0.1*sin(c)", "c": "-a - b"}, "2*a")
SHUFFLED = inline({"c": "-c*b", "a": "exp(-a)*b", "b": "c - b**2"}, "a")


@pytest.mark.parametrize("block", [AFFINE, BENT, SHUFFLED], ids=["affine", "bent", "shuffled"])
def test_the_state_is_found_again_from_the_derivatives_of_the_output(block: Block) -> None:
    """Phi(h, L_f h, ...) is the identity, without inputs."""
    model = model_of(block)
    form = lower_triangular_form(model, np.full(3, 0.5), np.zeros(0))
    derivatives = output_derivatives(model)
    for x in np.random.default_rng(0).uniform(0.2, 0.9, (10, 3)):
        Y = derivatives(0, x, ca.DM(0, 3), [])
        np.testing.assert_allclose(numbers(form.Phi(0, Y, ca.DM(0, 3), [], x * 1.2)), x, rtol=1e-9)


def test_with_an_input_the_derivatives_are_those_along_the_trajectory() -> None:
    """y = a^3 + 3 a, a' = b + u, b' = -a + u': written out by hand."""
    model = model_of(inline({"a": "b + u", "b": "-a"}, "a**3 + 3*a", inputs={"u": "sin(t)"}))
    Phi = reconstruction(model, (0, 1), [np.array([0.5, 0.4])], np.zeros(0)).function
    a, b, u, du = 0.6, -0.3, 0.25, 1.5
    Y = [a**3 + 3 * a, (3 * a**2 + 3) * (b + u)]
    np.testing.assert_allclose(numbers(Phi(0, Y, ca.DM([[u, du]]), [], [0.4, 0.0])), [a, b], rtol=1e-12)


def test_jets_are_the_chain_rule() -> None:
    model = model_of(inline({"a": "b", "b": "-a"}, "a", inputs={"u": "t"}))
    jets = Jets(model, 3)
    second = jets.derivative(jets.derivative(jets.of(model.x[0] ** 2 * model.u[0] + model.t)))
    x, dx, ddx, u, du, ddu = 0.7, -0.2, 0.4, 1.3, 0.5, -0.1
    X, U = ca.DM([[x, dx, ddx], [0, 0, 0]]), ca.DM([[u, du, ddu]])
    expected = 2 * (dx**2 + x * ddx) * u + 4 * x * dx * du + x**2 * ddu
    assert float(jets.function(second)(0, X, U, [])) == pytest.approx(expected, rel=1e-14)


def test_derivatives_of_inputs() -> None:
    t = ca.SX.sym("t")
    f = ca.Function("f", [t], [input_derivatives(ca.vertcat(ca.sin(2 * t), t**2), t, 3)])
    expected = [[np.sin(0.6), 2 * np.cos(0.6), -4 * np.sin(0.6)], [0.09, 0.6, 2]]
    np.testing.assert_allclose(np.asarray(f(0.3).full()), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        (inline({"a": "b", "b": "0"}, ["a", "b"]), "2 outputs"),
        (inline({"a": "b + c", "b": "c", "c": "0"}, "a"), "the derivative of a depends on b and c"),
        (inline({"a": "b", "b": "-a", "c": "-c"}, "a"), "state c does not appear in"),
    ],
)
def test_what_is_not_lower_triangular(block: Block, message: str) -> None:
    model = model_of(block)
    for form in (lower_triangular_form, derivative_form):
        with pytest.raises(NotObservableForm, match=message):
            form(model, np.full(model.n, 0.5), np.zeros(0))


def test_what_is_not_state_affine() -> None:
    with pytest.raises(NotObservableForm, match=r"the slope of the derivative of a in b is 2 and must be 1"):
        state_affine_form(model_of(AFFINE), np.full(3, 0.5), np.zeros(0))


def test_lower_triangular_order_is_that_of_the_equations() -> None:
    form = lower_triangular_form(model_of(SHUFFLED), np.full(3, 0.5), np.zeros(0))
    assert [form.model.states[i] for i in form.order] == ["a", "b", "c"]
    copy = form.copy(ca.SX(0), ca.SX(0, 1), ca.SX(0, 1), False, {})
    shift = np.asarray(copy.A.full())
    np.testing.assert_array_equal(shift[np.ix_(form.order, form.order)], np.eye(3, k=1))
    assert numbers(ca.evalf(copy.along(ca.SX([1, 2, 3])))).tolist() == [3, 1, 2]
    np.testing.assert_array_equal(
        np.diag(np.asarray(ca.evalf(copy.Theta(ca.SX(2))).full()))[list(form.order)], [2, 4, 8]
    )


def test_strict_feedback_sorts_and_divides() -> None:
    """x' = f_1 + g z: Psi of two exact Euler samples is z."""
    block = inline(
        {"z1": "-z1 + x2", "x1": "x1*x2 + (2 + x1**2)*z1", "x2": "-x1 + z1 - 3*z2", "z2": "z1*z2"}, ["x2", "x1"]
    )
    form = strict_feedback_form(model_of(block), np.full(4, 0.5), np.zeros(0))
    assert ([form.plant.states[i] for i in form.measured], [form.plant.states[i] for i in form.hidden]) == (
        ["x2", "x1"],
        ["z1", "z2"],
    )
    copy = form.copy(ca.SX(0), ca.SX(0, 1), ca.SX(0, 1), False, {})
    y, z, T = ca.SX([0.3, 0.7]), ca.SX([0.2, -0.4]), 0.1
    joined = copy.join(y, z)
    assert numbers(ca.evalf(joined)).tolist() == [0.2, 0.7, 0.3, -0.4]
    rates = [0.7 * 0.3 + (2 + 0.49) * 0.2, -0.7 + 0.2 + 1.2]  # of x1, x2
    np.testing.assert_allclose(numbers(ca.evalf(copy.f_1(y) + copy.g(y) @ z)), rates[::-1], rtol=1e-14)
    following = y + T * ca.SX(rates[::-1])
    np.testing.assert_allclose(numbers(ca.evalf(copy.Psi(y, following, ca.SX(T)))), [0.2, -0.4], rtol=1e-12)
    np.testing.assert_allclose(numbers(ca.evalf(copy.f_2(y, z))), [-0.2 + 0.3, -0.08], rtol=1e-14)
    assert numbers(ca.evalf(copy.hidden(joined))).tolist() == [0.2, -0.4]
    assert numbers(ca.evalf(copy.output(joined))).tolist() == [0.3, 0.7]


@pytest.mark.parametrize(
    ("dynamics", "output", "message"),
    [
        ({"x": "z**2", "z": "0"}, "x", "x' is not affine in z"),
        ({"x": "z", "z": "0"}, "2*x", "is not one of the states"),
        ({"x": "z", "z": "0"}, ["x", "z"], "all states are measured"),
        ({"x": "z", "z": "0", "v": "z"}, "x", "shows 1 of the 2 unmeasured states z, v"),
    ],
)
def test_what_is_not_strict_feedback(dynamics: dict[str, str], output: Any, message: str) -> None:
    model = model_of(inline(dynamics, output))
    with pytest.raises(NotObservableForm, match=message):
        strict_feedback_form(model, np.full(model.n, 0.5), np.zeros(0))


@pytest.mark.parametrize("seed", range(4))
def test_the_observability_map_and_its_jacobian(seed: int) -> None:
    """z = (h, L_f h, L_f^2 h): derivatives along the drift, J by central differences."""
    rng = np.random.default_rng(seed)
    a, b, c = rng.uniform(0.5, 1.5, 3)
    block = inline({"x": f"{a}*y + 0.3*sin(x)", "y": f"{b}*v*(2 + x*y)", "v": f"-{c}*x"}, "x + 0.1*x**3")
    model = model_of(block)
    form = canonical_form(model, np.full(3, 0.5), np.zeros(0))
    x = rng.uniform(0.2, 0.8, 3)
    np.testing.assert_allclose(
        numbers(form.Phi(x, [])), numbers(output_derivatives(model)(0, x, ca.DM(0, 3), [])), rtol=1e-12
    )
    h = 1e-6
    columns = [(numbers(form.Phi(x + h * e, [])) - numbers(form.Phi(x - h * e, []))) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(np.asarray(form.J(x, []).full()), np.column_stack(columns), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("dynamics", "output", "message"),
    [
        ({"a": "b", "b": "-a", "c": "-c"}, "a", r"\(a\) depends on the state c, now or later"),
        ({"a": "b + c", "b": "-b", "c": "-c"}, "a", r"rank 2 of 3\): b, c cannot be told apart from the output a"),
        ({"a": "b", "b": "c*sin(t)", "c": "-a"}, "a", "depends on time"),
        ({"a": "sqrt(-1 - a**2)*b", "b": "0"}, "a", "not a finite number near the initial state"),
        ({"a": "u*b", "b": "c + u", "c": "0"}, "a", "state b, c does not appear"),
    ],
)
def test_what_has_no_canonical_coordinates(dynamics: dict[str, str], output: Any, message: str) -> None:
    inputs = {"u": "sin(t)"} if any("u" in text.replace("sqrt", "") for text in dynamics.values()) else {}
    model = model_of(inline(dynamics, output, inputs=inputs))
    with pytest.raises(NotObservableForm, match=message):
        canonical_form(model, np.full(model.n, 0.5), np.zeros(0))
