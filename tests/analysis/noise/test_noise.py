"""Noise in linearised observers: norms, Sylvester's equation, held and sampled noise, against independent ways."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest
from examples import experiment
from scipy.linalg import expm

import hgorun
from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.sinusoids import amplitude, exponents, pi_eps
from hgorun.analysis.linear.transfer import h2, hinf, relevant, response
from hgorun.analysis.noise.continuous import continuous_power
from hgorun.analysis.noise.prediction import measured_noise, predicted_noise, without_noise
from hgorun.analysis.noise.sampled import SampledLoop
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import NoValue
from hgorun.noise.base import Draws, Wave
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare


def chain(n: int, phi: str = "0", **block: Any) -> PreparedRun:
    return prepare(experiment(examples.chain(n, phi, 0), {"o": block}, output_step=0.01))


def linear(n: int, **block: Any) -> Linear:
    observer = Linearisation(chain(n, **block), "o")
    return observer.at(0.0, observer.at_truth(np.zeros(n)))


FAMILIES = [
    {"type": "shgo", "theta": 3},
    *[{"type": "fhgo2", "theta": 3, "r": r} for r in (1, 2, 3)],
    {"type": "integral", "theta": 3, "r": 2},
    {"type": "lowpass", "theta": 3, "r": 1, "rho": 0.3},
    {"type": "treangle", "theta": 3},
    {"type": "low_power", "theta": 3},
]


@pytest.mark.parametrize(("n", "sigma"), [(2, [3.536, 15.81]), (3, [4.541, 41.83, 136.9])])
def test_white_noise(n: int, sigma: list[float]) -> None:
    np.testing.assert_allclose(h2(linear(n, type="shgo", theta=10)), sigma, rtol=5e-4)


@pytest.mark.costly
@pytest.mark.parametrize("block", FAMILIES, ids=lambda b: b["type"])
def test_h2_is_the_integral_of_the_frequency_response(block: dict[str, Any]) -> None:
    system = linear(3, **block)
    omega = np.concatenate([[0], np.logspace(-4, 6, 40_000)])
    power = np.trapezoid(np.abs(response(system, omega)[:, :, 0]) ** 2, omega, axis=0) / np.pi
    np.testing.assert_allclose(h2(system), np.sqrt(power), rtol=1e-4)


@pytest.mark.costly
@pytest.mark.parametrize("block", FAMILIES, ids=lambda b: b["type"])
def test_hinf_is_where_the_hamiltonian_gets_imaginary_eigenvalues(block: dict[str, Any]) -> None:
    system = relevant(linear(3, **block))
    norm, where = hinf(system)
    for i in range(3):
        C = system.L[[i]]
        at = np.abs(response(system, where[i])[0, i, 0])
        np.testing.assert_allclose(at, norm[i, 0], rtol=1e-9)
        for factor, imaginary in ((0.999, True), (1.001, False)):
            g = factor * norm[i, 0]
            H = np.block([[system.A, system.B @ system.B.T / g], [-C.T @ C / g, -system.A.T]])
            values = np.linalg.eigvals(H)
            # at zero frequency the pair on the axis meets at the origin
            assert np.any(np.abs(values.real) < 1e-6 * np.abs(values)) == imaginary


@pytest.mark.parametrize("block", FAMILIES, ids=lambda b: b["type"])
def test_sylvester_is_the_frequency_response(block: dict[str, Any]) -> None:
    run = chain(3, "-x1 - 2*x2 - 2*x3", **block)
    observer = Linearisation(run, "o")
    system = observer.at(0.0, observer.at_truth(np.zeros(3)))
    for eps in (1.0, 0.1, 0.01):
        found = np.hypot(*pi_eps(system, 2.0, eps).T)
        np.testing.assert_allclose(found, amplitude(run, "o", 2.0 / eps), rtol=1e-6)


def test_exponents() -> None:
    for r in (1, 2):

        def of_theta(factor: float, r: int = r) -> Linear:
            return linear(3, type="fhgo2", theta=2 * factor, r=r)

        in_eps, in_theta = exponents(of_theta(1), of_theta, 1e3)
        np.testing.assert_allclose(in_eps, r + 1, rtol=1e-3)
        np.testing.assert_allclose(in_theta, r + np.arange(1, 4), rtol=1e-3)


def test_marginal_is_refused() -> None:
    with pytest.raises(NoValue, match="not Hurwitz"):
        h2(Linear(np.zeros((1, 1)), np.zeros((1, 1)) + 1, np.zeros((1, 1)), np.eye(1), np.zeros((1, 1)), np.eye(1)))


def test_held_noise_is_a_long_sum() -> None:
    """The covariance of a sum of independent holds, from powers of the exponential."""
    system, hold = linear(2, type="shgo", theta=2), 0.05
    found = continuous_power(system, [NoiseTerms(draws=(Draws(0.5, 0.3, hold),))])
    fine = 40
    F = expm(system.A * hold / fine)
    G = np.linalg.solve(system.A, (F - np.eye(2)) @ system.B[:, 0])
    impulse = np.zeros((400 * fine, 2))
    x = np.zeros(2)
    for k in range(len(impulse)):
        x = F @ x + G * (k < fine)
        impulse[k] = x
    shift = (np.linalg.solve(-system.A, system.B[:, 0]) * 0.5) ** 2
    np.testing.assert_allclose(found, 0.3 * np.sum(impulse**2, axis=0) / fine + shift, rtol=2e-3)


def test_spectrum_and_lyapunov_equation_agree_on_held_noise() -> None:
    """The delayed way, by the spectrum, at a delay that makes no difference."""
    system, terms = linear(2, type="fhgo2", theta=2, r=1), [NoiseTerms(draws=(Draws(0.0, 0.3, 0.2),))]
    np.testing.assert_allclose(continuous_power(system, terms, 1e-6), continuous_power(system, terms), rtol=2e-3)


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.13])
def test_sampled_sinusoid_is_the_simulation(delay: float) -> None:
    terms = [{"amplitude": 0.7, "omega": 25.0}]
    config = {
        "time": {"end": 60, "output_step": 0.002},
        "plant": {"type": "integrator_chain", "n": 2, "phi": "0", "initial": {"x1": 0, "x2": 0}},
        "measurement": {"sampling": {"period": 0.1}, "delay": delay, "noise": [{"type": "sinusoids", "terms": terms}]},
        "observers": {"a": {"type": "shgo", "theta": 2}, "b": {"type": "fhgo2", "theta": 2, "r": 2}},
        "solver": {"method": "rk4", "step": 0.01},
    }
    experiment = hgorun.Experiment(config, name="test")
    run, result = prepare(experiment), hgorun.simulate(experiment)
    late = result.time > 20
    for label in ("a", "b"):
        observer = Linearisation(run, label)
        loop = SampledLoop(observer.at(0.0, observer.at_truth(np.zeros(2))), 0.1, delay)
        found = np.sqrt(loop.power([NoiseTerms(waves=(Wave(0.7, 25.0),))], 0.0))
        measured = np.sqrt(np.mean(result.observers[label].xhat[late] ** 2, axis=0))
        np.testing.assert_allclose(found, measured, rtol=0.01)


@pytest.mark.measured("{'sampling': {'period': 0.1}, 'delay': 0.02}")
@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{}, {"delay": 0.05}, {"sampling": {"period": 0.1}, "delay": 0.02}], ids=str)
def test_prediction_is_the_difference_to_the_run_without_noise(measurement: dict[str, Any]) -> None:
    noise = [{"type": "sinusoids", "terms": [{"amplitude": 0.7, "omega": 13.0}, {"amplitude": 0.4, "omega": 8.3}]}]
    config = {
        "time": {"end": 60, "output_step": 0.01},
        "plant": {
            "type": "integrator_chain",
            "n": 2,
            "phi": "-x1 - x2 + sin(t)",
            "initial": {"x1": 1, "x2": 0},
        },
        "measurement": measurement | {"noise": noise},
        "observers": {
            "SHGO": {"type": "shgo", "theta": 2},
            "FHGO": {"type": "fhgo2", "theta": 2, "r": 2},
            "Treangle": {"type": "treangle", "theta": 2},
        },
        "solver": {"method": "rk4", "step": 0.005},
    }
    experiment = hgorun.Experiment(config, name="test")
    noise_free = hgorun.simulate(without_noise(experiment))
    run, result = prepare(experiment), hgorun.simulate(experiment)
    for label in result.observers:
        predicted = predicted_noise(run, label, noise_free)
        np.testing.assert_allclose(predicted, measured_noise(result, noise_free, label), rtol=0.01)
