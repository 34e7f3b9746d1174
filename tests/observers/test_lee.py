"""The discrete observers of integrator chains, against plain loops and exact covariances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import experiment, simulated
from scipy.linalg import solve_discrete_lyapunov

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.hgo_fd import ForwardDifferenceObserver
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.canonical import CanonicalForm

EPS, ALPHA = 0.01, 0.04
STEPS = "0.04*0.01/(1 + k/20000)"
NOISE = [{"type": "uniform", "low": -0.5, "high": 0.5}]
LEE = {"type": "lee_second_order", "discretise": "euler", "initial": {"x1": 10, "x2": 10}}
FIXED = {"type": "hgo_fd", "eps": EPS, "gains": [2, 2]}
SA = {"type": "hgo_sa", "eps": EPS, "gains": [2, 2]}


def simulate(
    observer: dict[str, Any], end: float, sampling: dict[str, Any], plant: dict[str, Any] = LEE, **more: Any
) -> hgorun.Result:
    measurement = {"sampling": sampling, "noise": NOISE}
    common = {"end": end, "output_step": 4e-4, "measurement": measurement, "solver": {"method": "euler", "step": 1}}
    return simulated(plant, {"o": observer}, **{**common, **more})


def lee(x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -x[0] / (1 + x[0] ** 2) - x[1]])


def plainly(a: np.ndarray, y: np.ndarray, q: tuple[float, float] = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """x and xhat at every sample: (41) and (42) with a(k) for T; y are the noisy measurements."""
    x, estimate = np.empty((2, y.size, 2))
    x[0], (q1, q2) = (10, 10), q
    for k in range(y.size):
        estimate[k] = q1, q2 / EPS
        if k + 1 < y.size:
            x[k + 1] = x[k] + a[k] * lee(x[k])
            e = y[k] - q1
            q1, q2 = q1 + a[k] / EPS * (q2 + 2 * e), q2 + a[k] / EPS * 2 * e
    return x, estimate


def newest(result: hgorun.Result) -> np.ndarray:
    """For every output point the newest sample: the file holds the value after the jump."""
    return np.searchsorted(result.measurements.time, result.time * (1 + 1e-12) + 1e-12, side="right") - 1


@pytest.fixture(scope="module")
def fixed() -> hgorun.Result:
    return simulate(FIXED, 80, {"period": 4e-4})


@pytest.fixture(scope="module")
def sa() -> hgorun.Result:
    return simulate(SA, 19.18, {"steps": STEPS})


def difference(result: hgorun.Result) -> float:
    """Largest difference of plant and estimate from the plain loop, relative to the largest value."""
    t, y = result.measurements.time, result.measurements.y[:, 0]
    x, estimate = plainly(np.diff(t, append=np.nan), y)
    assert np.max(np.abs(y - x[:, 0])) <= 0.5
    k = newest(result)
    gap = np.abs(result.x - x[k]).max(), np.abs(result.observers["o"].xhat - estimate[k]).max()
    return float(max(gap)) / float(np.abs(estimate).max())


@pytest.mark.slow
def test_fixed_is_the_plain_loop(fixed: hgorun.Result) -> None:
    assert fixed.measurements.time.size == 200_001
    assert difference(fixed) < 1e-9


@pytest.mark.slow
def test_sa_is_the_plain_loop(sa: hgorun.Result) -> None:
    """The steps are those of the paper: t_k = sum of a(j)."""
    k = np.arange(sa.measurements.time.size)
    t = np.concatenate([[0], np.cumsum(ALPHA * EPS / (1 + k[:-1] / 20000))])
    np.testing.assert_allclose(sa.measurements.time, t, rtol=1e-12, atol=1e-12)
    assert sa.measurements.time.size == pytest.approx(2e5, rel=1e-3)
    assert difference(sa) < 1e-9


def test_value_after_the_jump_stands_at_the_sample() -> None:
    """q(k+1), made from y_k, is in the row of t_(k+1), and the initial estimate until then."""
    r = simulate({**FIXED, "initial": {"x1": 1, "x2": 5}}, 4e-3, {"period": 4e-4})
    y, xhat = r.measurements.y[:, 0], r.observers["o"].xhat
    np.testing.assert_array_equal(xhat[0], [1, 5])
    e = y[0] - 1
    np.testing.assert_allclose(xhat[1], [1 + 0.04 * (0.05 + 2 * e), (0.05 + 0.04 * 2 * e) / EPS], rtol=1e-14)
    x, estimate = plainly(np.full(y.size, 4e-4), y, (1, 5 * EPS))
    np.testing.assert_allclose(xhat, estimate, rtol=1e-12)
    np.testing.assert_allclose(r.x, x, rtol=1e-14)


def transition(a: float, h: tuple[float, float] = (2, 2)) -> tuple[np.ndarray, np.ndarray]:
    """Error of q from one sample to the next without the plant's phi: F and what multiplies the noise."""
    A_0 = np.array([[-h[0], 1], [-h[1], 0]])
    return np.eye(2) + a / EPS * A_0, a / EPS * np.array(h)


SCALE = np.array([1, 1 / EPS])


def test_stationary_spread_is_that_of_the_lyapunov_equation(fixed: hgorun.Result) -> None:
    F, G = transition(4e-4)
    P = solve_discrete_lyapunov(F, np.outer(G, G) / 12)
    exact = np.sqrt(np.diag(P)) * SCALE
    np.testing.assert_allclose(exact, [0.07216, 6.0116], rtol=1e-4)
    start = 20_000
    error = (fixed.observers["o"].xhat - fixed.x)[start:]
    correlation, power = [], np.eye(2)
    for _ in range(2000):
        power = F @ power
        correlation.append(np.diag(power @ P) / np.diag(P))
    several = 1 + 2 * np.sum(np.array(correlation) ** 2, axis=0)
    deviation = np.sqrt(several / (2 * len(error)))  # of an estimated standard deviation, relative
    assert np.all(deviation < 0.02)
    np.testing.assert_array_less(np.abs(error.std(axis=0) / exact - 1), 4 * deviation)


@pytest.mark.slow
def test_spread_of_sa_falls_as_the_covariance_says(sa: hgorun.Result) -> None:
    t = sa.measurements.time
    P, spread = np.zeros((2, 2)), np.empty((t.size, 2))
    for k, a in enumerate(np.diff(t)):
        spread[k] = np.sqrt(np.diag(P))
        F, G = transition(a)
        P = F @ P @ F.T + np.outer(G, G) / 12
    spread[-1] = np.sqrt(np.diag(P))
    spread *= SCALE
    np.testing.assert_allclose(spread[[20_000, 100_000, -1], 0], [0.0505, 0.0290, 0.0214], rtol=5e-3)
    np.testing.assert_allclose(spread[100_000], [0.02897, 2.3736], rtol=1e-3)
    late = newest(sa) > 20_000
    error = (sa.observers["o"].xhat - sa.x)[late] / spread[newest(sa)[late]]
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=0)), 1, atol=0.08)


def test_fixed_samples_for_sa_are_the_fixed_observer() -> None:
    """The step is the time between samples, whatever b says."""
    one, two = (simulate(o, 0.4, {"period": 4e-4}) for o in (FIXED, SA))
    np.testing.assert_array_equal(one.observers["o"].xhat, two.observers["o"].xhat)


def test_gains_are_poles() -> None:
    one = simulate(FIXED, 0.4, {"period": 4e-4})
    two = simulate({"type": "hgo_fd", "eps": EPS, "poles": ["-1+1j", "-1-1j"]}, 0.4, {"period": 4e-4})
    np.testing.assert_allclose(one.observers["o"].xhat, two.observers["o"].xhat, rtol=1e-12)


def test_third_order_chain_in_continuous_time() -> None:
    """Any order, an exact plant, lost samples: each step is as long as it took."""
    plant = {
        "type": "integrator_chain",
        "n": 3,
        "phi": "-x1 - 2*x2 - 2*x3 + u",
        "inputs": {"u": "sin(t)"},
        "initial": {"x1": 1, "x2": 0, "x3": 0},
    }
    r = simulate(
        {"type": "hgo_fd", "eps": 0.05, "poles": [-1, -2, -0.5]},
        4,
        {"period": 4e-3, "dropout": 0.2},
        plant,
        solver={"method": "rk4", "step": 0.01},
    )
    t, y = r.measurements.time, r.measurements.y[:, 0]
    h = np.poly([-1, -2, -0.5])[1:]
    A_0, D, q = np.eye(3, k=1) - np.outer(h, [1, 0, 0]), 0.05 ** np.arange(3), np.zeros(3)
    estimate = np.zeros((t.size, 3))
    for k in range(1, t.size):
        q = q + (t[k] - t[k - 1]) / 0.05 * (A_0 @ q + h * y[k - 1])
        estimate[k] = q / D
    assert np.diff(t).max() > 7e-3
    np.testing.assert_allclose(r.observers["o"].xhat, estimate[newest(r)], rtol=1e-9, atol=1e-9)


def test_plant_by_differences_feels_its_disturbance_and_input() -> None:
    """Both at the sample before."""
    plant = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1 + cos(t)*u"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0},
        "inputs": {"u": "sin(3*t)"},
        "disturbance": {"x2": "exp(-t)"},
        "discretise": "euler",
    }
    T = 0.02
    r = simulate(FIXED | {"eps": 0.1}, 0.4, {"period": T}, plant, time={"end": 0.4, "output_step": T})
    x = np.empty((21, 2))
    x[0] = 1, 0
    for k in range(20):
        t = k * T
        x[k + 1] = x[k] + T * np.array([x[k, 1], -x[k, 0] + np.cos(t) * np.sin(3 * t) + np.exp(-t)])
    np.testing.assert_allclose(r.x, x, rtol=1e-12, atol=1e-15)


def test_plant_by_differences_is_near_the_exact_one() -> None:
    """They agree to 7e-4 at the paper's step."""
    r = simulate(FIXED, 8, {"period": 4e-4})
    exact = simulate(
        FIXED,
        8,
        {"period": 4e-4},
        {k: v for k, v in LEE.items() if k != "discretise"},
        solver={"method": "rk4", "step": 0.01},
    )
    gap = np.abs(r.x - exact.x).max()
    assert 1e-4 < gap < 3e-3


SCHEDULE = "measurement.sampling"


@pytest.mark.parametrize(
    ("change", "steps", "key", "words"),
    [
        ({}, "0.01/(1 + k)", SCHEDULE, "spectral radius 1 .* expected less than 1"),
        ({}, "0.025*0.5/(1 + k)", SCHEDULE, "a/eps = alpha b = 1.25, expected less than 1"),
        ({}, "4e-4*(2 + sin(k))/(3 + k)", f"{SCHEDULE}.steps", "must not increase"),
        ({}, "4e-3/(1 + k)**2", f"{SCHEDULE}.steps", "fall like k\\^-2: their sum converges"),
        ({}, "4e-4*exp(-k/1000)", f"{SCHEDULE}.steps", "faster than any power"),
        ({}, "4e-4*(1 + where(k == 9, 0.02, 0))/(1 + k/20000)", f"{SCHEDULE}.steps", "must not increase, found a.8."),
        ({}, "4e-4", f"{SCHEDULE}.steps", "do not fall: the sum of their squares diverges.*hgo_fd"),
        ({}, "4e-4/(1 + k)**0.5", f"{SCHEDULE}.steps", "squares diverges"),
        ({"alpha": 0.05, "b": "1/(1 + k/20000)"}, STEPS, "observers.o.alpha", "the schedule has a.0. = 0.0004, but"),
        ({"alpha": 0.04, "b": "1/(1 + k/10000)"}, STEPS, "observers.o.alpha", "the schedule has a.1."),
        ({"alpha": 0.04, "b": "1/(1 + j)"}, STEPS, "observers.o.b", "`j`"),
        ({"gains": [2, -1]}, STEPS, "observers.o.gains", "must be Hurwitz"),
        ({"gains": [2]}, STEPS, "observers.o.gains", "expected 2 numbers; found 1"),
        ({"eps": 0}, STEPS, "observers.o.eps", "a number above 0"),
        ({"poles": -1}, STEPS, "observers.o", "either poles or gains"),
        ({"saturation": {"x1": [0, 1]}}, STEPS, "observers.o.saturation", "no state that could be given"),
    ],
)  # fmt: skip
def test_what_the_theorem_leaves_out_is_refused(change: dict[str, Any], steps: str, key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        simulate(SA | change, 0.002, {"steps": steps})
    assert error.value.key == key


@pytest.mark.parametrize("b", ["1/(1 + k/20000)", "1/(1 + k)**0.7", "(1 + k/100)**-1", "1/(2 + k)/log(2 + k)"])
def test_steps_that_fit_are_taken(b: str) -> None:
    simulate(SA | {"alpha": ALPHA, "b": b}, 0.001, {"steps": f"0.04*0.01*({b})"})


def test_steps_that_rise_once_are_refused() -> None:
    """Below the first step, and above the one before."""
    steps = "0.5*eps*(1/(k + 1) + where(k == 3, 0.2, 0))".replace("eps", str(EPS))
    with pytest.raises(ConfigError, match=r"the steps must not increase, found a\(2\) = .*, a\(3\) = ") as caught:
        simulate(SA, 0.02, {"steps": steps})
    assert caught.value.key == "measurement.sampling.steps"


@pytest.mark.parametrize("gains", [[2, 2], [3, 1], [1, 4]])
def test_the_longest_step_is_that_of_the_spectral_radius(gains: list[float]) -> None:
    """I + (a/eps) A_0 has an eigenvalue on the unit circle at a = eps min(-2 Re/|lambda|^2): there it is refused."""
    closed = np.array([[-gains[0], 1.0], [-gains[1], 0.0]])
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        stable = np.abs(np.linalg.eigvals(np.eye(2) + middle * closed)).max() < 1
        low, high = (middle, high) if stable else (low, middle)
    observer = SA | {"gains": gains}
    simulate(observer, 0.05, {"steps": f"{0.999 * low * EPS!r}/(1 + k/20000)"})
    with pytest.raises(ConfigError, match=f"expected less than {low:.5g}"):
        simulate(observer, 0.05, {"steps": f"{1.001 * low * EPS!r}/(1 + k/20000)"})
    made = experiment(LEE, {"o": FIXED | {"gains": gains}}, measurement={"sampling": {"period": 1e-3}})
    found, form = made.observers["o"], prepare(made).forms["o"]
    assert isinstance(found, ForwardDifferenceObserver)
    assert isinstance(form, CanonicalForm)
    assert found.longest_period(form).value == pytest.approx(low * EPS, rel=1e-9)


@pytest.mark.parametrize(
    ("states", "dynamics", "output", "words"),
    [
        (["x1", "x2"], {"x1": "x2 - x1", "x2": "-x1"}, "x1", "x1' = x2 alone, but here"),
        (["x1", "x2"], {"x1": "x2 + u", "x2": "-x1"}, "x1", "x1' = x2 alone"),
        (["x1", "x2"], {"x1": "x2", "x2": "-x1"}, "x2", "one output that is the first state, x1"),
        (["x1", "x2"], {"x1": "x2", "x2": "-x1"}, ["x1", "x2"], "one output"),
    ],
)
def test_other_plants_are_refused(states: list[str], dynamics: dict[str, str], output: Any, words: str) -> None:
    plant = {
        "states": states,
        "dynamics": dynamics,
        "output": output,
        "initial": dict.fromkeys(states, 1),
        "inputs": {"u": "sin(t)"},
    }
    with pytest.raises(ConfigError, match=words):
        simulate(FIXED, 0.4, {"period": 4e-4}, plant)


@pytest.mark.parametrize(
    ("measurement", "words"),
    [
        ({"sampling": "continuous"}, "sampled outputs"),
        ({"sampling": {"period": 4e-4}, "delay": 1e-3}, "without delay"),
    ],
)
@pytest.mark.parametrize("plant", [LEE, {k: v for k, v in LEE.items() if k != "discretise"}])
def test_jumps_need_samples_in_time(measurement: dict[str, Any], words: str, plant: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        simulate(FIXED, 0.4, {}, plant, measurement=measurement)
    assert error.value.key == ("plant.discretise" if "discretise" in plant else "observers.o")


def test_too_long_a_step_diverges() -> None:
    """T = 1.1 eps, against the limit T < eps of h = (2, 2)."""
    r = simulate(FIXED, 4, {"period": 0.011})
    assert r.observers["o"].diverged_at is not None
    assert np.isnan(r.observers["o"].xhat[-1]).all()
    assert simulate(FIXED, 4, {"period": 0.009}).observers["o"].diverged_at is None
