"""The KKL observer: Sylvester's equation, Luenberger's observer, values and errors computed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline, said, simulated, sinusoid
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hgorun
from hgorun.analysis.finding import FINDINGS
from hgorun.errors import ConfigError, Problem
from hgorun.export.prepared import exported
from hgorun.observers.kkl_keys import KklObserver
from hgorun.observers.kkl_map import _steps, left_inverse, of_linear_plant
from hgorun.observers.orbits import Escaped
from hgorun.result.result import Result
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare
from hgorun.symbolic.drift import DriftForm

OSCILLATOR = np.array([[0.0, 1.0], [-1.0, 0.0]])
DUFFING: Block = inline({"x1": "x2", "x2": "-x1 - x1**3"}, "x1", initial={"x1": 1, "x2": 0})
REST: Block = inline({"x1": "x2", "x2": "-x1"}, "x1", initial={"x1": 1, "x2": 0})
BOX: Block = {"x1": [-1.2, 1.2], "x2": [-1.2, 1.2]}
KKL: Block = {"type": "kkl", "m": 5, "box": BOX, "internal": {"z": 0}}


def driven() -> Block:
    return inline({"x1": "x2", "x2": "-x1 + u"}, "x1", inputs={"u": "sin(3*t) + 0.2"}, initial={"x1": 1, "x2": 0})


def test_rows_of_sylvesters_equation() -> None:
    """(lam, -1)/(lam^2 + 1) for the oscillator; two outputs of a random plant."""
    np.testing.assert_allclose(
        of_linear_plant(OSCILLATOR, np.eye(2)[:1], np.array([-2.0, -3.0])), [[0.4, -0.2], [0.3, -0.1]], atol=1e-15
    )
    random = np.random.default_rng(3)
    A, C, values = random.normal(size=(4, 4)), random.normal(size=(2, 4)), -np.arange(3.0, 9.0)
    T = of_linear_plant(A, C, values)
    residual = T @ A - np.tile(values, 2)[:, None] * T - np.repeat(C, len(values), axis=0)
    assert np.max(np.abs(residual)) < 1e-14


@pytest.mark.costly
def test_with_as_many_eigenvalues_as_states_it_is_luenbergers_observer() -> None:
    """L = (5, 5), also with an input and a constant."""
    kkl: Block = {"type": "kkl", "lam": [2, 3], "initial": {"x1": -1, "x2": 2}}
    found = simulated(driven(), {"K": kkl}, end=4, step=1e-3, measurement={"noise": sinusoid(0.1, 7)}).observers["K"]

    def rate(t: float, x: np.ndarray) -> list[float]:
        e = x[0] - solution(t)[0] - 0.1 * np.sin(7 * t)
        return [x[1] - 5 * e, -x[0] + np.sin(3 * t) + 0.2 - 5 * e]

    def plant(t: float, x: np.ndarray) -> list[float]:
        return [x[1], -x[0] + np.sin(3 * t) + 0.2]

    solution = solve_ivp(plant, (0, 4), [1, 0], rtol=1e-12, atol=1e-12, dense_output=True).sol
    expected = solve_ivp(rate, (0, 4), [-1, 2], rtol=1e-11, atol=1e-12, t_eval=np.linspace(0, 4, 41)).y.T
    np.testing.assert_allclose(found.xhat, expected, atol=1e-8)


def test_the_error_of_a_larger_z_decays_as_its_slowest_part() -> None:
    """z - T x = e^(Lam t) (z - T x)(0), m = 5."""
    result = simulated(driven(), {"K": {"type": "kkl", "theta": 2, "internal": {"z": [1, 2, 3, 4, 5]}}}, end=2)
    T = of_linear_plant(OSCILLATOR, np.eye(2)[:1], -2 * np.arange(1.0, 6.0))
    error = result.observers["K"].internal["z"] - result.x @ T.T
    np.testing.assert_allclose(error, np.exp(-2 * result.time[:, None] * np.arange(1, 6)) * error[0], atol=1e-7)


@pytest.fixture(scope="module", name="duffing")
def of_several_inverses() -> Result:
    blocks = {f"degree {d}": {**KKL, "degree": d} for d in (1, 2, 3)}
    blocks |= {"m 3": {**KKL, "m": 3}, "right": {**KKL, "internal": {}, "initial": {"x1": 1}}}
    return simulated(DUFFING, blocks, end=20, output_step=0.05, step=0.01)


def rms(result: Result) -> dict[str, np.ndarray]:
    late = result.time >= 10
    return {k: np.sqrt(np.mean((o.xhat - result.x)[late] ** 2, axis=0)) for k, o in result.observers.items()}


@pytest.mark.slow
def test_values_of_the_map_computed_elsewhere(duffing: Result) -> None:
    """T(1, 0), lam = 1..5."""
    expected = [0.359830, 0.344110, 0.276516, 0.223692, 0.185824]
    np.testing.assert_allclose(duffing.observers["right"].internal["z"][0], expected, atol=6e-7)


@pytest.mark.costly
def test_errors_of_the_inverse_computed_elsewhere(duffing: Result) -> None:
    found = rms(duffing)
    np.testing.assert_allclose(found["degree 1"], [3.17e-3, 4.72e-2], rtol=5e-3)
    np.testing.assert_allclose(found["degree 2"], found["degree 1"], rtol=1e-6)  # T is odd
    assert np.all(found["degree 3"] < [6e-7, 6e-6])
    np.testing.assert_allclose(found["m 3"], [6.5e-4, 2.1e-3], rtol=2e-2)


@pytest.mark.costly
def test_what_noise_does_computed_elsewhere() -> None:
    blocks = {"1": {**KKL, "degree": 1}, "3": KKL, "m 3": {**KKL, "m": 3}}
    measurement = {"noise": sinusoid(0.01, 20)}
    found = rms(simulated(DUFFING, blocks, end=20, output_step=0.02, step=0.01, measurement=measurement))
    np.testing.assert_allclose(found["1"], [6.0e-3, 5.3e-2], rtol=2e-2)
    np.testing.assert_allclose(found["3"], [3.5e-3, 4.6e-3], rtol=3e-2)
    np.testing.assert_allclose(found["m 3"], [3.3e-3, 7.0e-3], rtol=3e-2)


@pytest.mark.slow
def test_samples_have_a_map_of_their_own() -> None:
    """Exact for a linear plant, however long the period; a recursion in numpy for the other one."""
    sampling: Block = {"sampling": {"period": 0.5}}
    result = simulated(REST, {"K": {"type": "kkl", "lam": [0.7, 1.9]}}, end=20, output_step=0.5, measurement=sampling)
    A, Lam = expm(0.5 * OSCILLATOR), np.exp(-0.5 * np.array([0.7, 1.9]))
    T = of_linear_plant(A, np.eye(2)[:1], Lam)
    z, expected = np.zeros(2), [np.zeros(2)]
    for x in result.x[:-1]:
        z = Lam * z + x[0]
        expected.append(np.linalg.solve(T, z))
    np.testing.assert_allclose(result.observers["K"].xhat, expected, atol=1e-8)

    blocks = {"K": KKL, "right": {**KKL, "internal": {}, "initial": {"x1": 1}}}
    found = simulated(DUFFING, blocks, end=20, output_step=0.1, step=0.01, measurement={"sampling": {"period": 0.2}})
    assert np.all(rms(found)["right"] < [1e-5, 1e-4])
    assert np.all(rms(found)["K"] < [1e-3, 1e-2])  # what is left of the start


@pytest.mark.slow
def test_a_plant_that_escapes_backwards_is_clipped_on_request() -> None:
    block: Block = {"type": "kkl", "box": {"x1": [-2.5, 2.5], "x2": [-4, 4]}, "degree": 3, "points": 200}
    with pytest.raises(ConfigError, match=r"observers.K.box: backwards in time .* outside: saturate"):
        prepare(experiment(VAN_DER_POL, {"K": block}))
    result = simulated(VAN_DER_POL, {"K": {**block, "outside": "saturate", "theta": 2}}, end=20, step=0.01)
    assert np.all(rms(result)["K"] < [0.3, 0.9])


@pytest.mark.slow
def test_the_map_of_a_clipped_plant_converges_to_that_of_orbits_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it errs by is its own tolerance, not that of the oracle."""
    low, high, lam = np.array([-2.5, -4]), np.array([2.5, 4]), np.array([2.0, 4, 6])
    box = {"x1": [-2.5, 2.5], "x2": [-4, 4]}
    block: Block = {"type": "kkl", "box": box, "points": 20, "outside": "saturate", "theta": 2, "m": 3}
    run = prepare(experiment(VAN_DER_POL, {"K": block}))
    design = run.experiment.designs["K"]
    observer, form = design.observer, design.form
    assert isinstance(observer, KklObserver)
    assert isinstance(form, DriftForm)
    points = observer._points(form)[0]
    mu, stiffness = (run.plant.parameters[list(run.plant.model.parameters).index(name)] for name in ("mu", "stiffness"))

    def mapped(x: np.ndarray) -> np.ndarray:
        def backwards(s: float, y: np.ndarray) -> np.ndarray:
            a, b = np.clip(y[:2], low, high)
            return np.array([-b, -(stiffness * a + mu * (1 - a * a) * b), *(a * np.exp(-lam * s))])

        found = solve_ivp(backwards, (0, 10), [*x, 0, 0, 0], "DOP853", rtol=1e-12, atol=1e-14)
        return np.asarray(found.y[2:, -1])

    expected, errors = np.array([mapped(x) for x in points]), []
    for tolerance in (1e-6, 1e-8, 1e-10):
        monkeypatch.setattr("hgorun.observers.kkl_map._ACCURACY", tolerance)
        errors.append(np.max(np.abs(observer._mapped(form, points) - expected)))
    assert errors[0] < 1e-3
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 1e-6


@pytest.mark.measured
@pytest.mark.slow
def test_ridge_keeps_coefficients_small_and_the_analysis_says_what_that_costs() -> None:
    made = experiment(DUFFING, {"free": KKL, "ridge": {**KKL, "ridge": 1e-6}}, end=2, step=0.01)
    named = [FINDINGS.find(n) for n in ("inverse_error", "inverse_error_fitted", "inverse_weight", "poles")]
    found = hgorun.analyze(made, named).observers
    free, ridge = said(found["free"]), said(found["ridge"])
    assert free["inverse_weight"]["x2"] > 1e2 > 10 > ridge["inverse_weight"]["x2"]
    assert free["inverse_error"]["x2"] < 1e-4 < ridge["inverse_error"]["x2"] < 0.1
    assert "decays as exp(-theta lam t)" in found["free"].reasons["poles"]
    (linear,) = hgorun.analyze(experiment(driven(), {"K": {"type": "kkl"}}), named[:1]).observers.values()
    assert "inverse_error" not in linear.values


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.2}}])
def test_lanes(measurement: Block) -> None:
    runs = [
        prepare(experiment(DUFFING, {"K": {**KKL, "internal": {"z": 0.1 * k}}}, step=0.01, measurement=measurement))
        for k in range(8)
    ]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, run in enumerate(runs):
        assert np.array_equal(together.rows[..., lane], integrate(run, as_given(run)).rows[..., 0])


@pytest.mark.parametrize(
    ("plant", "block", "measurement", "message"),
    [
        (DUFFING, {"type": "kkl"}, {}, "box of x1, x2 is missing"),
        (DUFFING, {**KKL, "m": 1}, {}, "expected m >= n = 2"),
        (DUFFING, {**KKL, "m": 3, "lam": [1, 2]}, {}, "lam has 2 numbers, found m = 3"),
        (DUFFING, {"type": "kkl", "lam": [1, 1], "box": BOX}, {}, "expected different numbers"),
        (DUFFING, {**KKL, "box": {"x1": [-1, 1]}}, {}, "box of x2 is missing"),
        (DUFFING, {**KKL, "box": {**BOX, "q": [-1, 1]}}, {}, "unknown state 'q'"),
        (DUFFING, {**KKL, "grid": 1000}, {}, "points are more than"),
        (DUFFING, {**KKL, "points": 20}, {}, "at least as many points"),
        (DUFFING, KKL, {"delay": 0.1}, "delay|late"),
        (REST, {"type": "kkl"}, {"sampling": {"period": 0.1, "jitter": 0.01}}, "one period|mean time"),
        (driven(), {"type": "kkl", "lam": [1, 2]}, {"sampling": {"period": 0.1}}, "time or inputs enter the plant"),
        (driven(), KKL, {"sampling": {"period": 0.1}}, "the map of samples is that of one without"),
        (
            inline({"a": "-a**3 + u"}, "a", inputs={"u": "1"}),
            {"type": "kkl"},
            {},
            "a plant that moves by itself",
        ),
        (inline({"a": "-2*a", "b": "-b"}, ["a", "b"]), {"type": "kkl"}, {}, "is an eigenvalue of the plant"),
        (inline({"a": "-a", "b": "-b"}, "a"), {"type": "kkl", "theta": 1.3}, {}, "cannot be observed"),
    ],
)
def test_what_does_not_fit_is_refused(plant: Block, block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(plant, {"K": block}, measurement=measurement))


def test_it_is_not_exported() -> None:
    with pytest.raises(ConfigError, match="kkl is not exported"):
        exported(prepare(experiment(driven(), {"K": {"type": "kkl"}}, step=0.01)))


def chain(n: int) -> Block:
    """Integrators one after the other."""
    names = [f"x{i}" for i in range(1, n + 1)]
    return inline(dict(zip(names, [*names[1:], "0"], strict=True)), "x1", initial=dict.fromkeys(names, 1))


def test_a_chain_that_is_too_long_for_floating_point_numbers_is_not_called_unobservable() -> None:
    with pytest.raises(
        ConfigError, match=r"K\.lam: the plant can be observed, but .* 27 eigenvalues .* from -27 to -1"
    ):
        prepare(experiment(chain(13), {"K": {"type": "kkl"}}))
    prepare(experiment(chain(13), {"K": {"type": "kkl", "theta": 0.3}}))  # as the message says


@pytest.mark.parametrize("theta", [1, 0.3, 0.1])
def test_the_inverse_is_one(theta: float) -> None:
    """Where sizes of rows differ by more digits than numbers have, too."""
    A, values = np.eye(11, k=1), -theta * np.arange(1.0, 24.0)
    T = of_linear_plant(A, np.eye(11)[:1], values)
    assert np.max(np.abs(left_inverse(T, values) @ T - np.eye(11))) < 1e-4


def test_what_cannot_be_observed_is_still_told_apart() -> None:
    """A random plant of which three states drive nothing that is measured, and the same with a little of it."""
    random = np.random.default_rng(1)
    A, C, turn = random.normal(size=(6, 6)), np.zeros((2, 6)), np.linalg.qr(random.normal(size=(6, 6)))[0]
    A[:3, 3:], C[:, :3] = 0, random.normal(size=(2, 3))
    values = -np.arange(4.0, 17.0)
    with pytest.raises(Problem, match="the plant cannot be observed from its outputs"):
        of_linear_plant(turn.T @ A @ turn, C @ turn, values)
    A[0, 3:] = 1e-3
    assert of_linear_plant(turn.T @ A @ turn, C @ turn, values).shape == (26, 6)


def test_an_orbit_that_leaves_its_reach_has_escaped_there() -> None:
    """x' = x^2 from 1 is 1/(1 - t): from 2 on, a hundred reaches away at the latest just before t = 1."""
    start = np.array([1.0])
    with pytest.raises(Escaped) as caught:
        list(_steps(lambda s, x: x**2, start, 2.0, start[None], np.array([0.01])))
    assert np.array_equal(caught.value.x, start)
    assert 0 < caught.value.after < 1
