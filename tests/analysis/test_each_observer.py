"""Every observer of a run gets its own values: whatever the keys of its gain, and whatever runs beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize
from examples import VAN_DER_POL, Block, chain, experiment, inline, sinusoid

import hgorun
from hgorun.analysis.finding import FINDINGS
from hgorun.analysis.findings import stability
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.report import Findings

LIMITS = ("delay_critical", "delay_critical_chain", "period_critical", "period_critical_chain")

# x1' = x2 + x1/5, x2' = -2 x1 - 9 x2/10 + cos(t), and gains that place -0.7 and -1.6
A = np.array([[0.2, 1.0], [-2.0, -0.9]])
SECOND_ORDER = inline(
    {"x1": "x2 + 0.2*x1", "x2": "-2*x1 - 0.9*x2 + u"}, "x1", inputs={"u": "cos(t)"}, initial={"x1": 0.3, "x2": 0}
)
GAIN = np.array([2.3, 1.12])
S: Block = {"type": "shgo", "theta": 3, "poles": [-0.7, -1.6]}


def analysed(
    observers: dict[str, Block], names: Sequence[str] = LIMITS, plant: Block = SECOND_ORDER, **more: Any
) -> dict[str, Findings]:
    """What is found under some names only."""
    options: dict[str, Any] = {"end": 3, "output_step": 0.01, "step": 0.01} | more
    findings = [FINDINGS.find(name) for name in names]
    return dict(hgorun.analyze(experiment(plant, observers, **options), findings).observers)


def number(found: Findings, name: str) -> float:
    value = found.values[name]
    assert isinstance(value, float)
    return value


def numbers(found: Findings, name: str) -> list[float]:
    """By state."""
    value = found.values[name]
    assert isinstance(value, Mapping)
    return [float(one) for one in value.values()]


def lifted_period(d: float) -> float:
    """The period at which the radius of (xi, e) from an arrival to the next is 1, of samples that are d old then.

    xi' = A xi - G e, e' = -G_1 e: the innovation is predicted by what the correction has done. The sample of xi_1 that
    is on its way is predicted likewise.
    """
    G = np.array([3.0, 9.0]) * GAIN
    M = np.block([[A, -G[:, None]], [np.zeros((1, 2)), -G[:1, None]]])

    def radius(T: float) -> float:
        taken = scipy.linalg.expm(M * (T - d))
        arrived = scipy.linalg.expm(M * d) @ taken
        arrived[2] = taken[0] + arrived[2] - taken[2]
        return float(np.abs(np.linalg.eigvals(arrived)).max())

    grid = np.linspace(0.1, 3, 100)
    first = next(T for T in grid if radius(T) > 1)
    return float(scipy.optimize.brentq(lambda T: radius(T) - 1, first - 0.03, first))


def smallest_delay() -> float:
    """The smallest d with a root j omega: e = xi_1(t - d) + alpha(t) - alpha(t - d), alpha' = -G_1 e."""
    G = np.array([3.0, 9.0]) * GAIN
    found = []

    def determinant(w: float, d: float) -> complex:
        late = np.exp(-1j * w * d)
        e = late / (1 + G[0] * (1 - late) / (1j * w))
        return complex(np.linalg.det(1j * w * np.eye(2) - A + e * np.outer(G, [1, 0])))

    for w in np.geomspace(0.2, 20, 12):
        for d in np.linspace(0.1, 2, 8):
            root = scipy.optimize.root(lambda p: [determinant(*p).real, determinant(*p).imag], [w, d])
            if root.success and root.x[0] > 0.05 and root.x[1] > 1e-3:
                found.append(float(root.x[1]))
    return min(found)


@pytest.mark.slow
def test_limits_of_an_observer_beside_one_with_gains() -> None:
    T: Block = {"type": "treangle", "theta": 3, "gains": [2.2, 1.9, 2.1, 0.9]}
    values = analysed({"S": S, "T": T}, measurement={"delay": 0.05})["S"].values
    assert values["period_critical"] == pytest.approx(lifted_period(0.05), rel=2e-4)
    assert values["delay_critical"] == pytest.approx(smallest_delay(), rel=1e-6)
    assert values["period_critical"] == pytest.approx(1.1711, rel=2e-4)
    assert values["delay_critical"] == pytest.approx(0.88756, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "gains"),
    [
        ({"type": "shgo"}, [2, 1]),
        ({"type": "fhgo2", "r": 1}, [3, 3, 1]),
        ({"type": "integral", "r": 1}, [3, 3, 1]),
        ({"type": "lowpass", "r": 1, "rho": 0.2}, [2, 1]),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_gains_give_the_values_of_the_poles_that_they_place(block: Block, gains: list[float]) -> None:
    """The same observer has the same limits, however its gain is written."""
    placed, given = (
        analysed({"o": {**block, "theta": 3, **more}})["o"].values for more in ({"poles": -1}, {"gains": gains})
    )
    for name in LIMITS:
        assert given[name] == pytest.approx(placed[name], rel=1e-6), name


@pytest.mark.parametrize(
    ("plant", "block"),
    [
        (chain(2), {"type": "shgo", "theta": 2, "gains": [3, 2]}),
        (chain(2), {"type": "treangle", "theta": 2, "gains": [4, 6, 4, 1]}),
        (VAN_DER_POL, {"type": "direct", "theta": 2, "l": [2, 1]}),
    ],
)
def test_a_resolved_configuration_can_be_read_again(plant: Any, block: Block) -> None:
    made = experiment(plant, {"o": block})
    assert hgorun.Experiment(made.resolved()).resolved() == made.resolved()


@pytest.mark.costly
def test_an_observer_that_has_no_undisturbed_run_takes_nothing_from_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = nominal

    def failing(run: Any, label: str | None = None) -> Any:
        if label in (None, "bad"):
            raise NoValue("the observer called bad cannot be run")
        return whole(run, label)

    alone = analysed({"S": S})["S"].values
    monkeypatch.setattr(stability, "nominal", failing)
    found = analysed({"S": S, "bad": {"type": "shgo", "theta": 2}})
    for name in LIMITS:
        assert found["S"].values[name] == alone[name]
    assert found["bad"].reasons["period_critical"] == "the observer called bad cannot be run"


# a link that passes through small values: Riccati's equation has a positive eigenvalue there, the error has none
VARYING = inline(
    {"x1": "f*x2 - 0.3*x1", "x2": "-x1 - 0.5*x2"}, "x1", inputs={"f": "1 + 0.9*sin(t)"}, initial={"x1": 1, "x2": 0}
)
THETA, OMEGA = 3.0, 30.0


@cache
def gain_at_the_end(theta: float, end: float = 30.0) -> np.ndarray:
    """P of P' = theta (P + F P + P F^T - P C^T C P) from I, in the scaled coordinates."""

    def rate(t: float, p: np.ndarray) -> np.ndarray:
        P = p.reshape(2, 2)
        F = np.array([[0.0, 1 + 0.9 * np.sin(t)], [0.0, 0.0]])
        return np.asarray((theta * (P + F @ P + P @ F.T - np.outer(P[:, 0], P[0]))).ravel())

    found = scipy.integrate.solve_ivp(rate, (0, end), np.eye(2).ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    return np.asarray(found.y[:, -1].reshape(2, 2))


def error_at_the_end(theta: float) -> tuple[np.ndarray, np.ndarray]:
    """The error's matrix and how noise enters it at t = 30."""
    G = theta * np.array([1.0, theta]) * gain_at_the_end(theta)[:, 0]
    plant = np.array([[-0.3, 1 + 0.9 * np.sin(30.0)], [-1.0, -0.5]])
    return plant - np.outer(G, [1.0, 0.0]), G


def amplitude(theta: float, omega: float) -> np.ndarray:
    matrix, G = error_at_the_end(theta)
    return np.asarray(np.abs(np.linalg.solve(1j * omega * np.eye(2) - matrix, G)))


@pytest.mark.measured
@pytest.mark.slow
def test_the_error_decides_what_has_a_steady_state_not_its_gain() -> None:
    measurement = {"noise": sinusoid(0.1, OMEGA)}
    names = ("h2", "hinf", "noise_amplitude", "noise_exponent_eps", "noise_exponent_theta")
    observers: dict[str, Block] = {"R": {"type": "shgo_riccati", "theta": THETA}}
    found = analysed(observers, names, VARYING, end=30, measurement=measurement)["R"]
    matrix, G = error_at_the_end(THETA)
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(matrix)), [-3.445, -0.993], atol=5e-4)
    variance = scipy.linalg.solve_continuous_lyapunov(matrix, -np.outer(G, G))
    grid = np.append(0.0, np.geomspace(0.05, 50, 3000))
    expected = {
        "h2": np.sqrt(np.diag(variance)),
        "hinf": np.max([amplitude(THETA, w) for w in grid[::15]], axis=0),
        "noise_amplitude": 0.1 * amplitude(THETA, OMEGA),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(numbers(found, name), values, rtol=2e-4, err_msg=name)
    step = 1e-3

    def slope(more: np.ndarray, less: np.ndarray) -> np.ndarray:
        return np.asarray(np.log(more / less) / (2 * step))

    in_eps = slope(amplitude(THETA, OMEGA * np.exp(-step)), amplitude(THETA, OMEGA * np.exp(step)))
    in_theta = slope(amplitude(THETA * np.exp(step), OMEGA), amplitude(THETA * np.exp(-step), OMEGA))
    np.testing.assert_allclose(numbers(found, "noise_exponent_eps"), in_eps, rtol=1e-4)
    np.testing.assert_allclose(numbers(found, "noise_exponent_theta"), in_theta, rtol=1e-3)


def test_theta_bound_with_slopes_scaled_with_theta() -> None:
    """The smallest theta with theta >= 4 sqrt(chi_S) |M(theta)|; phi_1 = -0.3 x1, phi_2 = -x1 - x2/2."""
    observers: dict[str, Block] = {"R": {"type": "shgo_riccati", "theta": THETA}}
    found = analysed(observers, ("theta_bound", "chi_S"), VARYING, end=10)["R"]
    factor = 4 * np.sqrt(number(found, "chi_S"))

    def excess(theta: float) -> float:
        return float(theta - factor * np.linalg.norm([[0.3, 0.0], [1 / theta, 0.5]], 2))

    assert number(found, "theta_bound") == pytest.approx(scipy.optimize.brentq(excess, 1, 1e4), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("measurement", "words"), [({}, ""), ({"jitter": 0.01}, "out"), ({"dropout": 0.3}, "out")])
def test_limits_of_samples_that_get_lost_are_of_regular_ones(measurement: dict[str, float], words: str) -> None:
    found = analysed({"S": S}, measurement={"delay": 0.05, "sampling": {"period": 0.1, **measurement}})["S"]
    for name in LIMITS:
        (remark,) = [r for r in found.remarks if r.startswith(f"{name}:")]
        assert remark.endswith("; without jitter and dropout") == bool(words), remark


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["continuous", {"period": 0.1}])
@pytest.mark.parametrize("delay", [5e3, 1e300, "1e3*(1 + sin(t))"])
def test_however_late_a_measurement_is_numbers_do_not_overflow(sampling: object, delay: object) -> None:
    """Warnings are errors here, and those of findings become reasons."""
    measurement = {"delay": delay, "sampling": sampling, "noise": sinusoid(0.1, OMEGA)}
    every = list(FINDINGS.names())
    found = analysed({"S": S}, every, measurement=measurement)
    found |= analysed({"R": {"type": "shgo_riccati", "theta": THETA}}, every, VARYING, measurement=measurement)
    for one in found.values():
        assert not [reason for reason in one.reasons.values() if "raised" in reason]
