"""FHGO I: its poles, its limits, and what it does with several outputs."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest
from examples import chain

import hgorun
from hgorun.simulation.simulate import prepare

# P + A P + P A^T = P C^T C P
STATIONARY = {2: [[2, 1], [1, 1]], 3: [[3, 3, 1], [3, 5, 2], [1, 2, 1]]}


def experiment(n: int, observers: dict[str, Any], start: float = 0.5, **more: Any) -> hgorun.Experiment:
    """A chain with P at its stationary value from the start."""
    at_rest = {label: {"internal": {"P": STATIONARY[n]}, **block} for label, block in observers.items()}
    return examples.experiment(chain(n, start=start), at_rest, **{"end": 4, "step": 0.002, **more})


@pytest.mark.parametrize("theta", [1.0, 3.0])
@pytest.mark.parametrize("delta", [0.5, 3.0, 4.0, 20.0])
@pytest.mark.parametrize("n", [2, 3])
def test_poles_on_a_chain(n: int, delta: float, theta: float) -> None:
    """det(s I - M) = (s^2 + delta s + delta)^n at s/theta, for the matrix M of (xhat, eta).

    Compared as polynomials: the 2n-fold root of delta = 4 is defective, so eigenvalues would be off by 1e-3.
    """
    run = prepare(experiment(n, {"o": {"type": "fhgo1", "theta": theta, "delta": delta}}))
    system, numbers = run.structure.system, run.numbers
    states = numbers.observers[0].states
    places = [*range(n, 2 * n), *range(states["eta"].start, states["eta"].start + n)]

    def rate(z: np.ndarray) -> np.ndarray:
        return np.asarray(system.regimes[0].flow(0, numbers.p, z, np.zeros(system.held.size))).ravel()

    P = slice(states["P"].start, states["P"].start + states["P"].size)
    np.testing.assert_allclose(rate(numbers.z0)[P], 0, atol=1e-13)
    shifts = np.eye(len(numbers.z0))[places]
    M = np.column_stack([rate(numbers.z0 + shift) - rate(numbers.z0) for shift in shifts])[places]
    for s in theta * np.array([-3, -2, -0.5, 0, 0.7, 1j, 2j, 1 - 3j, -2 + 0.1j]):
        sigma = s / theta
        expected = theta ** (2 * n) * (sigma**2 + delta * sigma + delta) ** n
        scale = theta ** (2 * n) * (abs(sigma) ** 2 + delta * abs(sigma) + delta) ** n
        assert abs(np.linalg.det(s * np.eye(2 * n) - M) - expected) < 1e-12 * scale


def test_large_delta_is_the_standard_observer() -> None:
    """The filters' lag is 1/(delta theta): the distance halves when delta doubles."""
    blocks = {str(d): {"type": "fhgo1", "theta": 2, "delta": d} for d in (200, 400)}
    result = hgorun.simulate(experiment(3, {**blocks, "limit": {"type": "shgo_riccati", "theta": 2}}))
    gaps = [np.max(np.abs(result.observers[d].xhat - result.observers["limit"].xhat)) for d in ("200", "400")]
    assert gaps[0] / gaps[1] == pytest.approx(2, abs=0.1)


def test_noise_passes_as_many_filters_as_there_are_components() -> None:
    """phi = 0: component i falls like omega^-(i+1), its amplitude delta^i theta^(2i) k_i / omega^(i+1)."""
    theta, delta, k = 2.0, 3.0, (3, 3, 1)
    for omega in (200.0, 400.0):
        noise = [{"type": "sinusoids", "terms": [{"amplitude": 1, "omega": omega}]}]
        block = {
            "type": "fhgo1",
            "theta": theta,
            "delta": delta,
            "initial": {f"x{i}": 0.5 for i in (1, 2, 3)},
        }
        more: dict[str, Any] = {"step": 5e-4, "end": 25, "output_step": 1e-3}
        result = hgorun.simulate(experiment(3, {"o": block}, measurement={"noise": noise}, **more))
        late = result.time > 22
        e, t = (result.observers["o"].xhat - result.x)[late], result.time[late]
        basis = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones_like(t), t])
        parts = np.linalg.lstsq(basis, e, rcond=None)[0]
        amplitude = np.hypot(parts[0], parts[1])
        expected = [theta ** (2 * i) * delta**i * k[i - 1] / omega ** (i + 1) for i in (1, 2, 3)]
        np.testing.assert_allclose(amplitude, expected, rtol=(3 * theta * delta / omega))


@pytest.mark.costly
@pytest.mark.parametrize(("delta", "limit"), [(2, 1.079), (3, 1.307), (7, 2.028)])
def test_largest_sampling_period(delta: float, limit: float) -> None:
    """With the first form of alpha' in (2.75); the second has 0.623 for delta = 3 and 0.373 for 7."""
    block = {"type": "fhgo1", "theta": 1, "delta": delta, "initial": {"x1": 1}}
    more: dict[str, Any] = {"end": 2000, "output_step": 1, "step": 0.05}
    for period, grows in ((0.99 * limit, False), (1.01 * limit, True)):
        more["measurement"] = {"sampling": {"period": period}}
        result = hgorun.simulate(experiment(3, {"o": block}, start=0, **more))
        size = np.max(np.abs(result.observers["o"].xhat), axis=1)
        early, late = np.max(size[400:500]), np.max(size[1500:1600])
        assert (not np.isfinite(late) or late > 2 * early) if grows else late < 0.5 * early


def test_dimension() -> None:
    result = hgorun.simulate(experiment(3, {"o": {"type": "fhgo1", "theta": 2, "delta": 3}}))
    assert result.observers["o"].dimension == 3 + 3 + 6
    assert result.observers["o"].internal["eta"].shape == (41, 3)
