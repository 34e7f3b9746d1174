"""The moving-horizon estimator: the Kalman filter of a linear plant, and scipy's least squares of the same cost."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, inline, simulated
from scipy.integrate import solve_ivp
from scipy.linalg import expm, sqrtm
from scipy.optimize import least_squares

import hgorun
from hgorun.analysis.finding import FINDINGS
from hgorun.errors import ConfigError
from hgorun.export.prepared import exported
from hgorun.result.result import Result
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare

OSCILLATOR: Block = inline({"x1": "x2", "x2": "-x1"}, "x1", initial={"x1": 1, "x2": 0})
VAN_DER_POL: Block = {"type": "van_der_pol", "parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
T, R, Q = 0.2, 0.01, np.diag([0.0, 0.04])
MHE: Block = {"type": "mhe", "Q": {"x2": 0.04}, "R": R, "window": 3, "iterations": 1}
NOISE: list[Block] = [{"type": "expression", "value": "0.1*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]
SAMPLES: Block = {"sampling": {"period": T, "offset": T}, "noise": NOISE}


def noise(k: np.ndarray) -> np.ndarray:
    """Of sample k = 1, 2, ..."""
    return np.asarray(0.1 * np.sqrt(2) * np.sin(12.9898 * k**1.5 + k))


def run(block: Block, plant: Block = OSCILLATOR, measurement: Block = SAMPLES, end: float = 6) -> Result:
    return simulated(plant, {"M": block}, end=end, output_step=T, step=0.01, measurement=measurement)


def kalman(y: np.ndarray, Qd: np.ndarray) -> list[np.ndarray]:
    """The estimates of the oscillator behind samples, P(0) at the first one."""
    A, C = expm(T * np.array([[0.0, 1.0], [-1.0, 0.0]])), np.array([[1.0, 0.0]])
    x, P, found = np.zeros(2), np.eye(2), []
    for k, one in enumerate(y):
        if k:
            x, P = A @ x, A @ P @ A.T + Qd
        K = P @ C.T / (C @ P @ C.T + R)
        x, P = x + K[:, 0] * (one - x[0]), P - K @ C @ P
        found.append(x)
    return found


@pytest.mark.measured("change1-None")
@pytest.mark.slow
@pytest.mark.parametrize(("change", "Qd"), [({}, T * Q), ({"window": 5, "Qd": [[0.02, 0.01], [0.01, 0.03]]}, None)])
def test_on_a_linear_plant_it_is_the_kalman_filter(change: Block, Qd: np.ndarray | None) -> None:
    """Whatever N, with one iteration, from the first sample on."""
    result = run({**MHE, **change, "substeps": 40})
    k = np.arange(1, len(result.time))
    expected = kalman(np.cos(T * k) + noise(k), np.array(change["Qd"]) if Qd is None else Qd)
    np.testing.assert_allclose(result.observers["M"].xhat[1:], expected, atol=2e-9)


def fall(t: float, x: np.ndarray) -> list[float]:
    """A pendulum that is driven."""
    return [x[1], -np.sin(x[0]) - 0.2 * x[1] + np.sin(2 * t)]


PENDULUM: Block = inline(
    {"x1": "x2", "x2": "-sin(x1) - 0.2*x2 + u"}, "sin(x1)", inputs={"u": "sin(2*t)"}, initial={"x1": 1, "x2": 0}
)


def fitted(times: np.ndarray, y: np.ndarray, Qd: np.ndarray, R: float) -> np.ndarray:
    """The newest of the states that minimise the cost, the window holding all samples."""

    def moved(i: int, x: np.ndarray) -> np.ndarray:
        return np.asarray(solve_ivp(fall, (times[i], times[i + 1]), x, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1])

    xbar = solve_ivp(fall, (0, times[0]), [0.6, 0.1], rtol=1e-11, atol=1e-12).y[:, -1]
    root = np.linalg.inv(np.asarray(sqrtm(Qd)))

    def residuals(flat: np.ndarray) -> np.ndarray:
        x = flat.reshape(-1, 2)
        gaps = [root @ (x[i + 1] - moved(i, x[i])) for i in range(len(x) - 1)]
        return np.concatenate([x[0] - xbar, (np.sin(x[:, 0]) - y) / np.sqrt(R), *gaps])

    guess = [xbar]
    for i in range(len(times) - 1):
        guess.append(moved(i, guess[-1]))
    found = least_squares(residuals, np.concatenate(guess), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.asarray(found.x[-2:])


@pytest.mark.slow
def test_while_the_window_fills_it_is_the_least_squares_of_all_samples() -> None:
    """Samples at uneven times, an input of the past, scipy on the same cost."""
    Qd = np.array([[0.02, 0.005], [0.005, 0.03]])
    block = {**MHE, "Qd": Qd.tolist(), "iterations": 5, "initial": {"x1": 0.6, "x2": 0.1}, "substeps": 6}
    sampling: Block = {"sampling": {"times": [0.3, 0.5, 1.1]}, "noise": NOISE}
    result = simulated(PENDULUM, {"M": block}, end=1.1, output_step=0.1, step=0.005, measurement=sampling)
    times = np.array([0.3, 0.5, 1.1])
    truth = solve_ivp(fall, (0, 1.1), [1, 0], rtol=1e-11, atol=1e-12, t_eval=times).y[0]
    expected = fitted(times, np.sin(truth) + noise(np.arange(1, 4)), Qd, R)
    np.testing.assert_allclose(result.observers["M"].xhat[-1], expected, atol=1e-6)


@pytest.mark.slow
def test_a_longer_window_finds_back_from_a_wrong_start() -> None:
    """Where one linearisation is not enough: y = sin(x1)."""
    blocks: dict[str, Block] = {"M": {**MHE, "iterations": 3}, "E": {"type": "ekf", "Q": {"x2": 0.04}, "R": R}}
    blocks = {name: {**block, "initial": {"x1": -0.5, "x2": 1}} for name, block in blocks.items()}
    result = simulated(PENDULUM, blocks, end=4, output_step=T, step=0.01, measurement=SAMPLES)
    errors = {name: np.abs(o.xhat - result.x)[10:].max() for name, o in result.observers.items()}
    assert errors["M"] < 0.4


@pytest.mark.costly
def test_an_output_that_is_never_there_changes_nothing() -> None:
    two = {**OSCILLATOR, "output": ["x1", "x2"]}
    silent: Block = {**SAMPLES, "outputs": {"x2": {"sampling": {"period": T, "offset": 100}}}}
    one = run({**MHE, "R": R}, end=2)
    other = run({**MHE, "R": {"x1": R, "x2": 1}}, two, silent, end=2)
    np.testing.assert_allclose(other.observers["M"].xhat, one.observers["M"].xhat, atol=1e-13)


@pytest.mark.costly
def test_late_samples_are_as_good_as_early_ones() -> None:
    """Replayed: the estimate is that without delay, carried on by the plant."""
    arriving: Block = {"sampling": {"period": T, "offset": 2 * T}, "noise": NOISE, "delay": T}
    late = run(MHE, measurement=arriving, end=3)
    early = run(MHE, end=3)
    A = expm(T * np.array([[0.0, 1.0], [-1.0, 0.0]]))
    np.testing.assert_allclose(late.observers["M"].xhat[2:], early.observers["M"].xhat[1:-1] @ A.T, atol=1e-8)


@pytest.mark.slow
def test_lanes() -> None:
    runs = [
        prepare(
            experiment(VAN_DER_POL, {"M": {**MHE, "initial": {"x1": 0.1 * k}}}, step=0.02, end=2, measurement=SAMPLES)
        )
        for k in range(8)
    ]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, one in enumerate(runs):
        assert np.array_equal(together.rows[..., lane], integrate(one, as_given(one)).rows[..., 0])


@pytest.mark.slow
def test_process_noise_at_the_end_of_chains() -> None:
    """q, or theta with q = R T theta^(2n)."""
    blocks = {
        "q": {**MHE, "q": R * T * 3.0**4},
        "theta": {**MHE, "theta": 3},
        "Q": {**MHE, "Q": {"x2": R * T * 3.0**4}},
    }
    for name in ("q", "theta"):
        del blocks[name]["Q"]
    found = simulated(VAN_DER_POL, blocks, end=3, output_step=T, step=0.02, measurement=SAMPLES).observers
    for name in ("theta", "Q"):
        np.testing.assert_allclose(found[name].xhat, found["q"].xhat, rtol=1e-10)


def test_the_analysis_says_why_not() -> None:
    made = experiment(OSCILLATOR, {"M": MHE}, end=2, step=0.02, measurement=SAMPLES)
    (found,) = hgorun.analyze(made, [FINDINGS.find(name) for name in ("poles", "stationary_poles")]).observers.values()
    assert "window of samples" in found.reasons["poles"]
    assert "ask ekf" in found.reasons["stationary_poles"]


@pytest.mark.parametrize(
    ("plant", "change", "measurement", "message"),
    [
        (OSCILLATOR, {"window": 1}, SAMPLES, "n = 2 samples or more"),
        (OSCILLATOR, {"window": 200}, SAMPLES, "window"),
        (OSCILLATOR, {"iterations": 0}, SAMPLES, "iterations"),
        (OSCILLATOR, {"Qd": {"x2": 1}}, SAMPLES, "a number for each state"),
        (OSCILLATOR, {"Qd": [[1, 0], [0, 0]]}, SAMPLES, "positive definite"),
        (OSCILLATOR, {"Qd": [[1, 0]]}, SAMPLES, r"M.Qd: expected 2 rows"),
        (OSCILLATOR, {"q": 1}, SAMPLES, "one of Q, q and theta"),
        (OSCILLATOR, {"internal": {"nodes": 1}}, SAMPLES, "P alone can be given"),
        (OSCILLATOR, {}, {}, "sampled"),
    ],
)
def test_what_does_not_fit_is_refused(plant: Block, change: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(plant, {"M": {**MHE, **change}}, measurement=measurement))


def test_inputs_that_are_no_functions_of_time_are_refused() -> None:
    plant = inline({"x1": "x2", "x2": "u"}, "x1", inputs={"u": "controller"}, initial={"x1": 1, "x2": 0})
    law: Block = {"law": {"u": "-x1 - x2"}}
    closed = experiment(plant, {"M": {**MHE, "late": "drop"}}, measurement=SAMPLES, controller=law)
    with pytest.raises(ConfigError, match=r"observers\.M\.type: it asks for the inputs of times before"):
        prepare(closed)


def test_it_is_not_exported() -> None:
    with pytest.raises(ConfigError, match="mhe is not exported"):
        exported(prepare(experiment(OSCILLATOR, {"M": MHE}, step=0.01, measurement=SAMPLES)))
