"""How high-frequency noise reaches the estimates: exponents in eps = 1/omega and amplitudes, plant at rest.

The steady state under v = sin(omega t) is solved from the Jacobian of the flow that is compiled, and
compared with simulated runs. The laws are of first order in eps theta, which is kept small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_treangle import Array, chain, error_dynamics, experiment

import hgorun

SHGO = {"type": "shgo", "theta": 1}
TREANGLE = {"type": "treangle", "theta": 1}
LOW_POWER = {"type": "low_power", "theta": 1}


def with_filter(name: str, r: int) -> dict[str, Any]:
    return {"type": name, "theta": 1, "r": r} | ({"rho": 0.1} if name == "lowpass" else {})


def amplitudes(n: int, block: dict[str, Any], omega: float, phi: str = "0") -> Array:
    """Of the steady error in x_1..x_n: |(j omega I - M)^-1 b|."""
    M, b = error_dynamics(n, block, phi)
    return np.abs(np.linalg.solve(1j * omega * np.eye(len(b)) - M, b))[:n]


def exponents(n: int, block: dict[str, Any], phi: str = "0", eps: tuple[float, float] = (2e-4, 4e-4)) -> Array:
    """Slopes of the log of the amplitudes against log eps."""
    small, large = (amplitudes(n, block, 1 / e, phi) for e in eps)
    return np.log(large / small) / np.log(eps[1] / eps[0])


@pytest.mark.parametrize("n", [2, 3, 4])
def test_standard(n: int) -> None:
    np.testing.assert_allclose(exponents(n, SHGO, "-x1"), 1, rtol=0.02)


@pytest.mark.parametrize("r", [1, 2, 3])
@pytest.mark.parametrize("name", ["fhgo2", "integral", "lowpass"])
def test_filter_of_order_r(name: str, r: int) -> None:
    for phi in ("0", "-x1 - x2 - x3"):
        np.testing.assert_allclose(exponents(3, with_filter(name, r), phi, (2e-3, 4e-3)), r + 1, rtol=0.02)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_treangle(n: int) -> None:
    """i + 1; phi_n(x_1) alone brings 3 to the last component, and one more to each before it."""
    i = np.arange(1, n + 1)
    np.testing.assert_allclose(exponents(n, TREANGLE, eps=(2e-3, 4e-3)), i + 1, rtol=0.02)
    np.testing.assert_allclose(exponents(n, TREANGLE, "-x1"), np.minimum(i + 1, 3 + n - i), rtol=0.02)


def test_treangle_with_phi_in_every_equation() -> None:
    """min(i + 1, 3)."""
    states = [f"x{i + 1}" for i in range(5)]
    following = dict(zip(states, [*states[1:], "0"], strict=True))
    plant = {
        "states": states,
        "dynamics": {s: f"{following[s]} - x1" for s in states},
        "output": "x1",
        "initial": dict.fromkeys(states, 0),
    }
    found = exponents_of_run(plant, {"o": TREANGLE}, (200, 400))["o"]
    np.testing.assert_allclose(found, [2, 3, 3, 3, 3], rtol=0.02)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_low_power(n: int) -> None:
    """1, 2, ..., n - 1, n - 1; phi(x_1) brings 2 to the last component, and 3 to the one before it."""
    law = np.minimum(np.arange(1, n + 1), n - 1)
    np.testing.assert_allclose(exponents(n, LOW_POWER, eps=(2e-3, 4e-3)), law, rtol=0.02)
    law[-2:] = np.minimum(law[-2:], [3, 2])
    np.testing.assert_allclose(exponents(n, LOW_POWER, "-x1"), law, rtol=0.02)


# ---- amplitudes ----


@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_of_the_standard_observer(theta: float) -> None:
    """eps theta^j k_j."""
    found = amplitudes(3, SHGO | {"theta": theta}, 1e4)
    np.testing.assert_allclose(found, [theta**j * k / 1e4 for j, k in ((1, 3), (2, 3), (3, 1))], rtol=1e-3)


@pytest.mark.parametrize("r", [1, 2, 3])
@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_behind_filters(theta: float, r: int) -> None:
    """eps^(r+1) theta^(r+i) k_(r+i), and g_i / rho^r in place of k_(r+i)."""
    omega, i = 1e4, np.arange(1, 4)
    k = np.poly(-np.ones(r + 3))[1:]
    for name in ("fhgo2", "integral"):
        found = amplitudes(3, with_filter(name, r) | {"theta": theta}, omega)
        np.testing.assert_allclose(found, theta ** (r + i) * k[r:] / omega ** (r + 1), rtol=1e-3)
    found = amplitudes(3, with_filter("lowpass", r) | {"theta": theta}, 10 * omega)
    law = theta ** (r + i) * np.array([3, 3, 1]) / 0.1**r / (10 * omega) ** (r + 1)
    np.testing.assert_allclose(found, law, rtol=1e-3)


@pytest.mark.parametrize("theta", [1.0, 3.0])
def test_amplitude_of_treangle_and_low_power(theta: float) -> None:
    """Cascades: k_i theta^(2i) eps^(i+1), and k_12 ... k_(i-1,2) k_i1 theta^(2i-1) eps^i, the last beside it."""
    omega, i = 1e4, np.arange(1, 5)
    found = amplitudes(4, TREANGLE | {"theta": theta}, omega)
    np.testing.assert_allclose(found, np.array([4, 6, 4, 1]) * theta ** (2 * i) / omega ** (i + 1), rtol=1e-3)
    found = amplitudes(4, LOW_POWER | {"theta": theta}, omega)
    filtered = np.cumprod([1, 3, 1])  # c_i = k_12 ... k_i2, before block i + 1
    assert found[0] == pytest.approx(2 * theta / omega, rel=1e-3)
    assert found[3] == pytest.approx(filtered[2] / 3 * theta**6 / omega**3, rel=1e-3)


# ---- what runs ----


def amplitudes_of_run(plant: dict[str, Any], observers: dict[str, Any], omega: float) -> dict[str, Array]:
    """Of simulated errors: the fit of a sine to the last two time units, the transient e^-t having died out."""
    step, end = 2 * np.pi / omega / 60, 50.0
    more = {
        "time": {"end": end, "output_step": float(step)},
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


def exponents_of_run(
    plant: dict[str, Any], observers: dict[str, Any], omega: tuple[float, float]
) -> dict[str, Array]:
    low, high = (amplitudes_of_run(plant, observers, w) for w in omega)
    return {label: np.log(low[label] / high[label]) / np.log(omega[1] / omega[0]) for label in observers}


BLOCKS = {
    "shgo": SHGO,
    "treangle": TREANGLE,
    "low_power": LOW_POWER,
    **{f"{name} {r}": with_filter(name, r) for name in ("fhgo2", "integral", "lowpass") for r in (1, 2)},
}


@pytest.mark.parametrize("phi", ["0", "-x1"])
def test_simulated_amplitudes_are_the_frequency_response(phi: str) -> None:
    for omega in (30.0, 100.0):
        found = amplitudes_of_run(chain(3, phi, 0), BLOCKS, omega)
        for label, block in BLOCKS.items():
            np.testing.assert_allclose(found[label], amplitudes(3, block, omega, phi), rtol=1e-4, err_msg=label)


def test_simulated_exponents() -> None:
    found = exponents_of_run(chain(3, start=0), BLOCKS, (250, 500))
    laws = {"shgo": [1, 1, 1], "treangle": [2, 3, 4], "low_power": [1, 2, 2]}
    for label in BLOCKS:
        law = laws.get(label) or [int(label[-1]) + 1] * 3
        np.testing.assert_allclose(found[label], law, rtol=0.02, err_msg=label)
