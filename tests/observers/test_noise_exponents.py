"""How high-frequency noise reaches the estimates: exponents in eps = 1/omega and amplitudes, plant at rest.

The steady state under v = sin(omega t) is solved from the Jacobian of the flow that is compiled, and
compared with simulated runs. The laws are of first order in eps theta, which is kept small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import chain
from plain import Array, error_dynamics, experiment

import hgorun

SHGO = {"type": "shgo", "theta": 1}
TREANGLE = {"type": "treangle", "theta": 1}
LOW_POWER = {"type": "low_power", "theta": 1}
WEAK = "-0.05*x1"  # keeps every observer stable at theta = 1


def with_filter(name: str, r: int) -> dict[str, Any]:
    return {"type": name, "theta": 1, "r": r} | ({"rho": 0.1} if name == "lowpass" else {})


def amplitudes(plant: dict[str, Any], block: dict[str, Any], omega: float) -> Array:
    """Of the steady error in x_1..x_n: |(j omega I - M)^-1 b|."""
    M, b = error_dynamics(plant, block)
    assert np.linalg.eigvals(M).real.max() < 0
    return np.abs(np.linalg.solve(1j * omega * np.eye(len(b)) - M, b))[: len(plant["initial"])]


def exponents(plant: dict[str, Any], block: dict[str, Any], eps: float = 2e-3) -> Array:
    """Slopes of the log of the amplitudes against log eps."""
    small, large = (amplitudes(plant, block, 1 / e) for e in (eps, 2 * eps))
    return np.log2(large / small)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_standard(n: int) -> None:
    np.testing.assert_allclose(exponents(chain(n, WEAK), SHGO), 1, rtol=0.02)


@pytest.mark.costly
@pytest.mark.parametrize("r", [1, 2, 3])
@pytest.mark.parametrize("name", ["fhgo2", "integral", "lowpass"])
def test_filter_of_order_r(name: str, r: int) -> None:
    for phi in ("0", "-0.1*x1 - 0.1*x2 - 0.1*x3"):
        np.testing.assert_allclose(exponents(chain(3, phi), with_filter(name, r)), r + 1, rtol=0.02)


@pytest.mark.costly
@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_treangle(n: int) -> None:
    """i + 1; phi_n(x_1) alone brings 3 to the last component, and one more to each before it."""
    i = np.arange(1, n + 1)
    np.testing.assert_allclose(exponents(chain(n), TREANGLE), i + 1, rtol=0.02)
    np.testing.assert_allclose(exponents(chain(n, WEAK), TREANGLE), np.minimum(i + 1, n + 3 - i), rtol=0.02)


def test_treangle_with_phi_in_every_equation() -> None:
    """min(i + 1, 3)."""
    states = [f"x{i + 1}" for i in range(5)]
    following = dict(zip(states, [*states[1:], "0"], strict=True))
    plant = {
        "states": states,
        "dynamics": {s: f"{following[s]} - 0.05*x1" for s in states},
        "output": "x1",
        "initial": dict.fromkeys(states, 0),
    }
    np.testing.assert_allclose(exponents(plant, TREANGLE, 1e-4), [2, 3, 3, 3, 3], rtol=0.02)


@pytest.mark.costly
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 7])
def test_low_power(n: int) -> None:
    """1, 2, ..., n - 1, n - 1; phi(x_1) brings 2 to the last component, and one more to each before it."""
    i = np.arange(1, n + 1)
    law = np.minimum(i, n - 1)
    np.testing.assert_allclose(exponents(chain(n), LOW_POWER), law, rtol=0.02)
    law = np.minimum(law, n + 2 - i)
    np.testing.assert_allclose(exponents(chain(n, WEAK), LOW_POWER, 1e-4), law, rtol=0.02)


# ---- amplitudes ----


@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_of_the_standard_observer(theta: float) -> None:
    """eps theta^j k_j."""
    found = amplitudes(chain(3), SHGO | {"theta": theta}, 1e4)
    np.testing.assert_allclose(found, [theta**j * k / 1e4 for j, k in ((1, 3), (2, 3), (3, 1))], rtol=1e-3)


@pytest.mark.parametrize("r", [1, 2, 3])
@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_behind_filters(theta: float, r: int) -> None:
    """eps^(r+1) theta^(r+i) k_(r+i), and g_i / rho^r in place of k_(r+i)."""
    omega, i = 1e4, np.arange(1, 4)
    k = np.poly(-np.ones(r + 3))[1:]
    for name in ("fhgo2", "integral"):
        found = amplitudes(chain(3), with_filter(name, r) | {"theta": theta}, omega)
        np.testing.assert_allclose(found, theta ** (r + i) * k[r:] / omega ** (r + 1), rtol=1e-3)
    found = amplitudes(chain(3), with_filter("lowpass", r) | {"theta": theta}, 10 * omega)
    law = theta ** (r + i) * np.array([3, 3, 1]) / 0.1**r / (10 * omega) ** (r + 1)
    np.testing.assert_allclose(found, law, rtol=1e-3)


@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_of_treangle_and_low_power(theta: float) -> None:
    """Treangle: k_i theta^(2i) eps^(i+1). Low-power: c_(i-1) k_i1 theta^(2i-1) eps^i, the last component
    c_(n-1) theta^(2n-2) eps^(n-1), with c_i = k_12 ... k_i2."""
    omega, i = 1e4, np.arange(1, 5)
    found = amplitudes(chain(4), TREANGLE | {"theta": theta}, omega)
    np.testing.assert_allclose(found, np.array([4, 6, 4, 1]) * theta ** (2 * i) / omega ** (i + 1), rtol=1e-3)
    found = amplitudes(chain(4), LOW_POWER | {"theta": theta}, omega)
    k, c = 2, [1, 3, 3, 1]
    law = [k * c[0] * theta, k * c[1] * theta**3, k * c[2] * theta**5, c[3] * theta**6]
    np.testing.assert_allclose(found, law / omega ** np.array([1, 2, 3, 3]), rtol=1e-3)


# ---- what runs ----


def amplitudes_of_run(plant: dict[str, Any], observers: dict[str, Any], omega: float) -> dict[str, Array]:
    """Of simulated errors: a sine fitted to the last two time units, the transient e^-t having died out."""
    step, end = 2 * np.pi / omega / 60, 50.0
    more = {
        "time": {"end": end, "output_step": 5 * float(step)},
        "solver": {"step": float(step)},
        "measurement": {"noise": [{"type": "sinusoids", "terms": [{"amplitude": 1, "omega": omega}]}]},
    }
    result = hgorun.simulate(experiment(plant, observers, **more))
    t = result.time[result.time > end - 2]
    wave = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones_like(t)])
    return {
        label: np.hypot(*np.linalg.lstsq(wave, found.xhat[-len(t) :])[0][:2])
        for label, found in result.observers.items()
    }


def exponents_of_run(plant: dict[str, Any], observers: dict[str, Any], omega: tuple[float, float]) -> dict[str, Array]:
    low, high = (amplitudes_of_run(plant, observers, w) for w in omega)
    return {label: np.log(low[label] / high[label]) / np.log(omega[1] / omega[0]) for label in observers}


BLOCKS = {
    "shgo": SHGO,
    "treangle": TREANGLE,
    "low_power": LOW_POWER,
    **{f"{name} {r}": with_filter(name, r) for name in ("fhgo2", "integral", "lowpass") for r in (1, 2)},
}


@pytest.mark.slow
@pytest.mark.parametrize("phi", ["0", WEAK])
def test_simulated_amplitudes_are_the_frequency_response(phi: str) -> None:
    plant = chain(3, phi, start=0)
    for omega in (30.0, 100.0):
        found = amplitudes_of_run(plant, BLOCKS, omega)
        for label, block in BLOCKS.items():
            np.testing.assert_allclose(found[label], amplitudes(plant, block, omega), rtol=1e-4, err_msg=label)


@pytest.mark.costly
def test_simulated_exponents() -> None:
    found = exponents_of_run(chain(3, start=0), BLOCKS, (100.0, 200.0))
    laws = {"shgo": [1, 1, 1], "treangle": [2, 3, 4], "low_power": [1, 2, 2]}
    for label in BLOCKS:
        law = laws.get(label) or [int(label[-1]) + 1] * 3
        np.testing.assert_allclose(found[label], law, rtol=0.02, err_msg=label)
