"""Kalman filters, against Riccati's equation, the discrete filter, and trajectories computed elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, simulated
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov, solve_discrete_are

import hgorun
from hgorun.analysis.noise.prediction import predicted_noise, without_noise
from hgorun.errors import ConfigError
from hgorun.observers.base import AnyObserver
from hgorun.observers.ekf import ExtendedKalmanFilter
from hgorun.observers.kalman_bucy import KalmanBucyFilter
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.testing import check_observer

VDP: Block = {"type": "van_der_pol", "parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
OSCILLATOR = chain(2, "-x1", [1, 0])


def late_noise(std: float) -> list[Block]:
    """Noise that anybody can make: sample number k + 1 of std sqrt(2) sin(12.9898 k^1.5 + k)."""
    return [{"type": "expression", "value": f"{std}*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]


def samples(std: float, period: float = 0.2) -> Block:
    return {"sampling": {"period": period, "offset": period}, "noise": late_noise(std)}


@pytest.mark.slow
@pytest.mark.parametrize("family", [KalmanBucyFilter, ExtendedKalmanFilter])
def test_contract(family: type[AnyObserver]) -> None:
    check_observer(family)


def test_contract_on_chains() -> None:
    """With theta in place of Q a block is another observer, of another class of plants."""
    block = KalmanBucyFilter.model_validate({"type": "kalman_bucy", "theta": 2, "R": 0.1})
    assert type(block).__name__ == "ChainKalmanBucyFilter"
    found = simulated(OSCILLATOR, {"a": {"type": "kalman_bucy", "theta": 2, "R": 0.1, "coordinates": "canonical"}})
    assert np.all(np.isfinite(found.observers["a"].xhat))


@pytest.mark.parametrize("n", [2, 3, 4])
def test_theta_gives_the_standard_observer_with_butterworth_poles(n: int) -> None:
    butterworth = {2: (1.414214, 1), 3: (2, 2, 1), 4: (2.613126, 3.414214, 2.613126, 1)}[n]
    found = simulated(chain(n), {"K": {"type": "kalman_bucy", "theta": 2, "R": 0.01}}, end=20, step=2e-3)
    G = found.observers["K"].internal["P"][-1][:, 0] / 0.01
    np.testing.assert_allclose(G, [g * 2**i for i, g in enumerate(butterworth, 1)], rtol=1e-6)


def test_two_outputs_settle_on_the_solution_of_riccatis_equation() -> None:
    A = np.array([[0, 1, 0], [-1, -0.2, 0.5], [0.3, 0, -0.4]])
    H = np.array([[1, 0, 0], [0.5, 0, 2]])
    Q, R = np.array([[0.2, 0.05, 0], [0.05, 0.1, 0], [0, 0, 0.3]]), np.diag([0.01, 0.04])
    dynamics = {"a": "b", "b": "-a - 0.2*b + 0.5*c", "c": "0.3*a - 0.4*c"}
    plant = inline(dynamics, {"one": "a", "two": "0.5*a + 2*c"})
    keys = {"Q": Q.tolist(), "R": {"one": 0.01, "two": 0.04}}
    found = simulated(plant, {"K": {"type": "kalman_bucy", **keys}}, end=40, step=5e-3).observers["K"]
    np.testing.assert_allclose(found.internal["P"][-1], solve_continuous_are(A.T, H.T, Q, R), rtol=0, atol=1e-9)


def test_density_of_the_noise_is_that_of_the_measurement() -> None:
    """R_c = std^2 dt of held draws, std^2 T of samples, and of several outputs each its own."""
    held: Block = {"noise": [{"type": "gaussian", "std": 0.3, "hold": 0.02}]}
    sampled: Block = {"noise": [{"type": "uniform", "low": -0.3, "high": 0.3}], "sampling": {"period": 0.05}}
    for measurement, R in ((held, 0.09 * 0.02), (sampled, 0.03 * 0.05)):
        blocks: dict[str, Block] = {
            "own": {"type": "kalman_bucy", "Q": {"x2": 1}, "internal": {"P": 0.01}},
            "given": {"type": "kalman_bucy", "Q": {"x2": 1}, "internal": {"P": 0.01}, "R": R},
        }
        found = simulated(OSCILLATOR, blocks, step=0.01, measurement=measurement).observers
        np.testing.assert_allclose(found["own"].internal["P"], found["given"].internal["P"], rtol=1e-12)


def test_a_changed_noise_changes_the_design() -> None:
    measurement = {"noise": [{"type": "gaussian", "std": 0.3}], "sampling": {"period": 0.05}}
    base = experiment(OSCILLATOR, {"K": {"type": "ekf", "theta": 2}}, step=0.01, measurement=measurement)
    first = hgorun.simulate(base).observers["K"]
    varied = hgorun.simulate(base.varied({"measurement.noise.0.std": 0.6})).observers["K"]
    measurement["noise"] = [{"type": "gaussian", "std": 0.6}]
    again = simulated(OSCILLATOR, {"K": {"type": "ekf", "theta": 2}}, step=0.01, measurement=measurement).observers["K"]
    assert np.array_equal(varied.xhat, again.xhat)
    assert not np.array_equal(varied.internal["P"], first.internal["P"])


def test_linear_theory_of_kalman_bucy() -> None:
    """Where nothing but the sensor is noisy: the power of the error by Lyapunov's equation, which analyze tells."""
    noise = {"noise": [{"type": "gaussian", "std": 0.2, "hold": 0.01}]}
    block = {"type": "kalman_bucy", "theta": 3, "internal": {"P": 0.05}}
    run = prepare(experiment(chain(2, "-x1"), {"K": block}, end=20, step=5e-3, measurement=noise))
    found = predicted_noise(run, "K", simulate_prepared(prepare(without_noise(run.experiment))))
    A, C, R = np.array([[0.0, 1], [-1, 0]]), np.eye(2)[:1], 0.04 * 0.01
    P = solve_continuous_are(A.T, C.T, np.diag([0, R * 3**4]), np.array([[R]]))
    K = P @ C.T / R
    error = solve_continuous_lyapunov(A - K @ C, -K @ K.T * R)
    np.testing.assert_allclose(found, np.sqrt(np.diag(error)), rtol=0.02)


# --- the continuous-discrete filter


def discrete_filter(A: np.ndarray, Q: np.ndarray, R: float, T: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The textbook's Kalman filter with van Loan's matrices: posterior estimates and the last P."""
    n = len(A)
    block = expm(np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * T)
    Phi = block[n:, n:].T
    Qd, C = Phi @ block[:n, n:], np.eye(n)[:1]
    x, P, found = np.zeros(n), np.eye(n), []
    for one in y:
        x, P = Phi @ x, Phi @ P @ Phi.T + Qd
        K = P @ C.T / (C @ P @ C.T + R)
        x, P = x + K[:, 0] * (one - x[0]), P - K @ C @ P
        found.append(x)
    return np.array(found), P


def test_ekf_of_a_linear_plant_is_the_discrete_kalman_filter() -> None:
    A, Q, T = np.array([[0.0, 1], [-1, 0]]), np.diag([0, 0.04]), 0.2
    block = {"type": "ekf", "Q": {"x2": 0.04}, "R": 0.01}
    result = simulated(OSCILLATOR, {"K": block}, end=20, output_step=0.2, measurement=samples(0.1),
                       solver={"method": "dopri5", "step": 0.01})  # fmt: skip
    k = np.arange(1, 101)
    y = np.cos(T * k) + 0.1 * np.sqrt(2) * np.sin(12.9898 * k**1.5 + k)
    found = result.observers["K"]
    xhat, P = discrete_filter(A, Q, 0.01, T, y)
    np.testing.assert_allclose(found.xhat[1:], xhat, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.internal["P"][-1], P, rtol=0, atol=1e-12)
    np.testing.assert_allclose(P[np.triu_indices(2)], [4.14535e-3, 5.44549e-3, 2.21009e-2], rtol=2e-6)
    whole = expm(np.block([[-A, Q], [np.zeros((2, 2)), A.T]]) * T)
    Phi = whole[2:, 2:].T
    prior = solve_discrete_are(Phi.T, np.eye(2)[:, :1], Phi @ whole[:2, 2:], np.array([[0.01]]))
    K = prior[:, :1] / (prior[0, 0] + 0.01)
    np.testing.assert_allclose(found.internal["P"][-1], prior - K @ prior[:1], rtol=0, atol=1e-9)


# t: xhat_1, xhat_2, P_11, P_12, P_22; an independent simulator, RK4 with steps of 0.01
TRAJECTORY = {
    0.2: (1.047392, 0.023025, 0.0024938, 0.0000548, 1.2201034),
    0.4: (0.984190, -0.404456, 0.0023814, 0.0111407, 0.1123973),
    1: (0.520962, -1.063258, 0.0015273, 0.0027990, 0.0098921),
    2: (-0.740023, -1.460627),
    10: (-1.477115, 1.000225),
    20: (0.993660, -1.391134, 0.0009892, 0.0014615, 0.0050745),
}


def test_trajectory_computed_elsewhere() -> None:
    block = {"type": "ekf", "Q": {"x2": 0.01}, "R": 0.0025}
    found = simulated(VDP, {"K": block}, end=20, output_step=0.2, step=0.01, measurement=samples(0.05)).observers["K"]
    P = found.internal["P"]
    values = np.column_stack([found.xhat, P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]])
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(values[round(5 * t), : len(expected)], expected, rtol=0, atol=6e-7)


def test_short_periods_lead_to_the_standard_observer() -> None:
    """The gain K/(T theta^i) tends to Butterworth's, first order in T."""
    expected = {0.1: (1.1525, 0.8089), 0.05: (1.2743, 0.8994)}
    for T, gains in expected.items():
        block = {"type": "ekf", "theta": 3, "R": 0.01}
        found = simulated(
            chain(2), {"K": block}, end=6, output_step=T, step=T / 20, measurement={"sampling": {"period": T}}
        )
        P = found.observers["K"].internal["P"][-1]  # after the sample: K = P H^T/R
        np.testing.assert_allclose(P[:, 0] / 0.01 / T / [3, 9], gains, atol=6e-5)


TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"angle": "a", "energy": "b**2/2 - cos(a)"})


@pytest.mark.costly
def test_outputs_that_come_together_enter_at_one_estimate() -> None:
    """Against the textbook's formula with the inverse of a matrix, the output that is missing left out."""
    measurement: Block = {
        "noise": [{"type": "expression", "value": "0.1*sin(7*k)"}],
        "outputs": {
            "angle": {"sampling": {"period": 0.5, "offset": 0.5}},
            "energy": {"sampling": {"period": 1, "offset": 1}},
        },
    }
    keys = {"type": "ekf", "Q": {"b": 0.1}, "R": {"angle": 0.02, "energy": 0.05}, "initial": {"a": 0.3, "b": 0.1}}
    result = simulated(TWO, {"K": keys}, end=1.5, output_step=0.05, step=0.01, measurement=measurement)
    found, measured = result.observers["K"], result.measurements
    x, P = _flown(found.xhat[10], found.internal["P"][10], 0.5)
    h = np.array([x[0], x[1] ** 2 / 2 - np.cos(x[0])])
    H = np.array([[1, 0], [np.sin(x[0]), x[1]]])
    R = np.diag([0.02, 0.05])
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    sample = measured.y[1]
    np.testing.assert_allclose(found.xhat[20], x + K @ (sample - h), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.internal["P"][20], P - K @ H @ P, rtol=0, atol=1e-9)


def _flown(x: np.ndarray, P: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and P of the pendulum without samples, by RK4."""

    def rate(x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        F = np.array([[0, 1], [-np.cos(x[0]), -0.1]])
        return np.array([x[1], -np.sin(x[0]) - 0.1 * x[1]]), F @ P + P @ F.T + np.diag([0, 0.1])

    steps = 500
    h = span / steps
    for _ in range(steps):
        a = rate(x, P)
        b = rate(x + h / 2 * a[0], P + h / 2 * a[1])
        c = rate(x + h / 2 * b[0], P + h / 2 * b[1])
        d = rate(x + h * c[0], P + h * c[1])
        x, P = (v + h / 6 * (p + 2 * q + 2 * r + s) for v, p, q, r, s in zip((x, P), a, b, c, d, strict=True))
    return x, P


@pytest.mark.costly
def test_an_output_without_samples_is_as_if_it_were_not_there() -> None:
    keys = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.02}
    one = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"angle": "a"})
    measurement: Block = {"sampling": {"period": 0.2, "offset": 0.1}, "noise": late_noise(0.1)}
    alone = simulated(one, {"K": keys}, end=3, step=0.01, measurement=measurement).observers["K"]
    lost = measurement | {"outputs": {"energy": {"sampling": {"period": 1, "dropout": 1}}}}
    both = simulated(TWO, {"K": keys}, end=3, step=0.01, measurement=lost).observers["K"]
    np.testing.assert_allclose(alone.xhat, both.xhat, rtol=0, atol=1e-15)
    np.testing.assert_allclose(alone.internal["P"], both.internal["P"], rtol=1e-14)


@pytest.mark.costly
def test_alone_and_in_company_with_outputs_at_their_own_times() -> None:
    measurement: Block = {
        "noise": [{"type": "gaussian", "std": 0.05}],
        "outputs": {"angle": {"sampling": {"period": 0.1}}, "energy": {"sampling": {"period": 0.37}}},
    }
    keys: Block = {"type": "ekf", "Q": {"b": 0.1}}
    others: Block = {"B": {"type": "kalman_bucy", "Q": {"b": 1}}}
    base = experiment(TWO, {"K": keys}, end=2, step=0.01, measurement=measurement)
    alone = hgorun.simulate(base).observers["K"].xhat
    company = simulated(TWO, others | {"K": keys, "L": keys | {"R": 0.1}}, end=2, step=0.01, measurement=measurement)
    assert np.array_equal(company.observers["K"].xhat, alone)


def test_noise_in_proportion_to_the_output() -> None:
    """R h(xhat)^2, whichever h."""
    measurement: Block = {"sampling": {"period": 0.5, "offset": 0.5}, "mode": "multiplicative",
                          "noise": [{"type": "gaussian", "std": 0.1}]}  # fmt: skip
    plant = inline({"x": "-0.2*x"}, "x", 4.0)
    result = simulated(plant, {"K": {"type": "ekf", "Q": {"x": 0.01}, "initial": {"x": 3}}}, end=0.5, output_step=0.5,
                       step=0.005, measurement=measurement)  # fmt: skip
    xhat = 3 * np.exp(-0.1)
    P = np.exp(-0.2) + 0.01 * (1 - np.exp(-0.2)) / 0.4
    R = 0.01 * xhat**2
    np.testing.assert_allclose(result.observers["K"].internal["P"][-1, 0, 0], P * R / (P + R), rtol=1e-9)


def test_wrapped_output() -> None:
    """An angle that is known up to whole turns: the same estimates as from the angle itself."""
    plant = {"states": ["a", "b"], "dynamics": {"a": "b", "b": "0"}, "initial": {"a": 0, "b": 2}}
    keys = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": {"b": 1.5}}
    measurement = samples(0.05)
    plain = simulated({**plant, "output": {"y": "a"}}, {"K": keys}, end=10, step=0.01, measurement=measurement)
    wrapped = simulated({**plant, "output": {"y": {"value": "a", "period": "2*pi"}}}, {"K": keys}, end=10, step=0.01,
                        measurement=measurement)  # fmt: skip
    np.testing.assert_allclose(wrapped.observers["K"].xhat, plain.observers["K"].xhat, rtol=0, atol=1e-12)


GAUSSIAN: Block = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}


@pytest.mark.parametrize(
    ("block", "measurement", "message"),
    [
        ({}, GAUSSIAN, "by one of Q, q and theta; found none of them"),
        ({"Q": {"x2": 1}, "q": 1}, GAUSSIAN, "found Q and q"),
        (
            {"Q": {"x2": 1}},
            {"sampling": {"period": 0.1}},
            "from the measurement: the output has no noise",
        ),
        ({"Q": {"x2": 1}}, samples(0.1), "noise of type expression has no spectrum"),
        ({"Q": {"x2": 1}}, GAUSSIAN | {"noise": [{"type": "gaussian", "snr_db": 20}]}, "relative to the output"),
        ({"Q": {"x3": 1}}, GAUSSIAN, "unknown state 'x3'"),
        ({"Q": [[1, 0]]}, GAUSSIAN, "expected 2 rows of 2 numbers"),
        ({"Q": [[1, 2], [2, 1]]}, GAUSSIAN, "without negative eigenvalues"),
        ({"Q": 3}, GAUSSIAN, "expected a number for each state, found 3"),
        ({"Q": {"x2": 1}, "R": {"z": 1}}, GAUSSIAN, "unknown output 'z'"),
        ({"Q": {"x2": 1}, "R": 0}, GAUSSIAN, "a number above 0"),
        ({"Q": {"x2": 0}}, GAUSSIAN, "stops correcting"),
        ({"Q": [[0, 0], [0, 0]]}, GAUSSIAN, "stops correcting"),
        ({"Q": {"x2": 1}, "R": {"x1": -1}}, GAUSSIAN, "observers.K.R.x1: expected a number above 0"),
        ({"Q": {"x2": 1}, "internal": {"P": -1}}, GAUSSIAN, "must be positive definite"),
        ({"Q": {"x2": 1}, "R": 1}, {}, "this needs sampled outputs, but x1 is continuous"),
        ({"theta": 2, "R": 1}, {"sampling": {"steps": "0.1"}}, "the time between samples of x1 is not known"),
    ],
)
def test_what_does_not_fit_is_refused(block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(OSCILLATOR, {"K": {"type": "ekf"} | block}, measurement=measurement))


def test_phases_of_other_noise_do_not_give_one_number() -> None:
    phases = [{"until": 0.5}, {"until": 1, "noise": [{"type": "gaussian", "std": 0.2}]}]
    with pytest.raises(ConfigError, match="the noise changes from one phase to the next"):
        hgorun.simulate(
            experiment(OSCILLATOR, {"K": {"type": "ekf", "q": 1}}, measurement=GAUSSIAN | {"phases": phases})
        )


def test_phases_with_other_sampling_have_one_variance() -> None:
    phases = [{"until": 0.5}, {"until": 1, "sampling": {"period": 0.05}}]
    measurement = GAUSSIAN | {"phases": phases}
    filters = {"K": {"type": "ekf", "q": 1}, "L": {"type": "ekf", "q": 1, "R": 0.01}}
    found = simulated(OSCILLATOR, filters, measurement=measurement).observers
    np.testing.assert_allclose(found["K"].internal["P"], found["L"].internal["P"], rtol=1e-12)
    with pytest.raises(ConfigError, match="or changes"):
        simulated(OSCILLATOR, {"B": {"type": "kalman_bucy", "q": 1}}, measurement=measurement)


@pytest.mark.costly
def test_a_battery_that_no_observer_of_chains_takes() -> None:
    """Open-circuit voltage, polarisation, ohmic drop: the state of charge within 1 % from a start 40 % off."""
    plant: Block = {
        "states": ["s", "v1"],
        "dynamics": {"s": "-I/Q", "v1": "-v1/(R1*C1) + I/C1"},
        "output": {"V": "3.2 + 0.9*s + 0.15*exp(-20*(1 - s)) - 0.25*exp(-30*s) - v1 - R0*I"},
        "parameters": {"Q": 7200, "R0": 0.05, "R1": 0.03, "C1": 2000},
        "inputs": {"I": "where(t - 600*floor(t/600) < 300, 1.5, 0)"},
        "initial": {"s": 0.9, "v1": 0},
    }
    measurement = {"sampling": {"period": 1}, "noise": [{"type": "gaussian", "std": 0.001}]}
    filters = {"E": {"type": "ekf", "Q": {"s": 1e-10, "v1": 1e-10}, "initial": {"s": 0.5}, "internal": {"P": 0.1}}}
    result = simulated(plant, filters, end=3600, output_step=10, measurement=measurement)
    assert np.max(np.abs(result.observers["E"].xhat - result.x)[60:, 0]) < 0.01
    with pytest.raises(ConfigError, match=r"observers for this plant are .*ekf"):
        simulated(plant, {"S": {"type": "shgo", "theta": 0.02}}, end=3600, output_step=10, measurement=measurement)


@pytest.mark.costly
def test_members_of_a_sweep_have_the_design_of_their_own_noise(tmp_path: Path) -> None:
    base = experiment(OSCILLATOR, {"K": {"type": "ekf", "theta": 2}}, step=0.01, measurement=GAUSSIAN)
    axes = {"measurement.noise.0.std": [0.1, 0.2, 0.4], "seed": [1, 2]}
    swept = hgorun.sweep(base, axes, output=tmp_path / "swept.h5")
    rmse = swept.to_xarray()["rmse"].values
    alone = hgorun.simulate(base.varied({"measurement.noise.0.std": 0.4}, seed=2)).observers["K"]
    assert np.array_equal(np.ravel(rmse[-1, -1]), alone.metrics["rmse"])
