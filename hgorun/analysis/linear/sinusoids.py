"""Steady states under sinusoidal noise of one observer: Sylvester's equation, amplitudes, exponents."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import response, steady_part
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

_RATIO = 1e-4  # half of the relative step of the slopes: central differences, error of the order of its square


def pi_eps(linear: Linear, omega: float, eps: float = 1.0, output: int = 0) -> np.ndarray:
    """The steady state L Pi w under the noise v = sin(omega t/eps), w = (sin, cos)(omega t/eps).

        Pi S = eps (A Pi + B R),    S = [[0, omega], [-omega, 0]],    R = (1, 0)

    Returns
    -------
    ndarray, shape (n, 2)
        Row i has the amplitudes of sine and cosine in xhat_i.

    Raises
    ------
    NoValue
        When the linearisation is not Hurwitz.

    Notes
    -----
    Astolfi, Marconi, Praly, Teel 2016; Robles Magdaleno 2023, (3.53), there with Lambda, Gamma for A, B. Lemma
    1 of the former prints (dPsi/dw) S w for (1/eps) (dPsi/dw) S w.
    """
    from scipy.linalg import solve_sylvester

    linear = steady_part(linear)
    S = np.array([[0.0, omega], [-omega, 0.0]])
    BR = np.outer(linear.B[:, output], [1.0, 0.0])
    return np.asarray(linear.L @ solve_sylvester(eps * linear.A, -S, -eps * BR))


def amplitude(
    run: PreparedRun | Experiment,
    label: str,
    omega: float | np.ndarray,
    *,
    x: np.ndarray | None = None,
    output: int = 0,
) -> np.ndarray:
    """Steady amplitude of each state of the estimate under the noise sin(omega t) on a continuous output.

    Parameters
    ----------
    run : PreparedRun or Experiment
    label : str
        Of the observer.
    omega : float or ndarray, shape (W,)
        For noise sin(omega t/eps) give omega/eps.
    x : ndarray, shape (n,), optional
        The plant's state to linearise at, which the observer has found (default: the initial one). Gains that are
        states are as they start.
    output : int
        Which output is noisy.

    Returns
    -------
    ndarray, shape (n,) or (W, n)

    Raises
    ------
    NoValue
        When the linearisation is not Hurwitz.
    """
    run = prepare(run) if isinstance(run, Experiment) else run
    linear = _at_truth(run, label, x)
    found = np.abs(response(linear, np.atleast_1d(omega))[:, :, output])
    return np.asarray(found if np.ndim(omega) else found[0])


def _at_truth(run: PreparedRun, label: str, x: np.ndarray | None) -> Linear:
    observer = Linearisation(run, label)
    at = observer.at_truth(run.plant.initial if x is None else np.asarray(x, dtype=float))
    return steady_part(observer.at(run.time.start, at))


def exponents(
    linear: Linear, of_theta: Callable[[float], Linear] | None, omega: float, output: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of the log of the amplitudes against log eps = -log omega and against log theta.

    Parameters
    ----------
    linear : Linear
    of_theta : callable or None
        The same system with theta times a factor near 1; None where there is no theta.
    omega : float
        Of the noise sin(omega t).
    output : int
        Which output is noisy.

    Returns
    -------
    tuple of ndarray, shapes (n,)
        In eps and in theta; NaN in theta without ``of_theta``, and where noise does not reach a state.
    """

    def size(system: Linear, factor: float = 1.0) -> np.ndarray:
        return np.asarray(np.abs(response(system, np.array([omega * factor]))[0, :, output]))

    less, more = np.exp([-_RATIO, _RATIO])
    in_eps = _slope(size(linear, more), size(linear, less))
    if of_theta is None:
        return in_eps, np.full(in_eps.shape, np.nan)
    return in_eps, _slope(size(of_theta(less)), size(of_theta(more)))


def _slope(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Of the logarithms; NaN where noise does not reach a state."""
    reached = (low > 0) & (high > 0)
    return np.log(np.where(reached, high, np.nan) / np.where(reached, low, np.nan)) / (2 * _RATIO)


def with_theta(experiment: Experiment, label: str, theta: float) -> Experiment:
    """The experiment with another theta in one observer, and no other observer."""
    others: dict[str, float | None] = {f"observers.{other}": None for other in experiment.observers if other != label}
    return experiment.varied(others | {f"observers.{label}.theta": float(theta)})
