"""The noise in the estimates in the steady state of a linearisation that does not change: continuous outputs."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.delay_margin import delay_margin
from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.linear.transfer import discrete_covariance, response, steady_part
from hgorun.analysis.noise.terms import NoiseTerms, grouped, require_spectra
from hgorun.analysis.reasons import NEEDS_HOLD, NoValue, outcome
from hgorun.noise.base import Draws

_LOBES = 200  # of the spectrum of held noise: what is behind them is 1/(pi^2 lobes) of the power, filtered


def continuous_power(linear: Linear, terms: list[NoiseTerms], delay: float = 0.0) -> np.ndarray:
    """Mean square of the noise in each state of the estimate, over all time, with continuous outputs.

    Parameters
    ----------
    linear : Linear
        At one point.
    terms : list of NoiseTerms
        Of every output, independent of each other but for their sinusoids.
    delay : float
        The same constant delay of all outputs.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    NoValue
    """
    linear = steady_part(linear)
    if delay > 0:
        _require_stable(linear, delay)
    require_spectra(terms)
    power: np.ndarray = constant(linear, terms, delay) ** 2
    outputs = [i for i, t in enumerate(terms) for _ in grouped(t.waves)]
    waves = [w for t in terms for w in grouped(t.waves)]
    if waves:
        G = response(linear, np.array([w.omega for w in waves]), delay)
        for omega in {w.omega for w in waves}:  # one phasor a frequency, over all outputs
            same = [(k, i) for k, i in enumerate(outputs) if waves[k].omega == omega]
            phasors = np.array([G[k][:, i] * waves[k].phasor for k, i in same])
            power += np.abs(phasors.sum(axis=0)) ** 2 / 2
    for i, t in enumerate(terms):
        for d in t.draws:
            if d.variance > 0:
                power += held_power(linear, d, i) if delay == 0 else _delayed_power(linear, d, i, delay)
    return power


def _require_stable(linear: Linear, delay: float) -> None:
    """Refuse a delay beyond the observer's margin: its response is a number there, too, but no steady state."""
    margin = outcome(lambda: delay_margin(linear.A0, linear.E, linear.H, linear.K0, linear.K)).found
    if margin is not None and delay >= margin:
        raise NoValue(
            f"the delay {delay:.4g} is beyond the stability limit {margin:.4g} of the linearisation, both in the unit "
            "of time of the run"
        )


def constant(linear: Linear, terms: list[NoiseTerms], delay: float = 0.0) -> np.ndarray:
    """The shift of the estimate by the constant part of the noise, shape (n,)."""
    return np.asarray(response(linear, np.zeros(1), delay)[0].real @ [t.mean for t in terms])


def held_power(linear: Linear, draws: Draws, output: int) -> np.ndarray:
    """Mean square under noise drawn every ``hold`` and constant in between, averaged over the hold.

    With x = (d xi, v): exact discretisation over one hold, the discrete Lyapunov equation for the covariance at
    its start, and the integral of L exp(M tau) over it.
    """
    from scipy.linalg import expm

    if draws.hold is None or not np.isfinite(draws.hold):
        raise NoValue(NEEDS_HOLD)
    N = linear.A.shape[0]
    M = np.zeros((N + 1, N + 1))
    M[:N, :N], M[:N, N] = linear.A, linear.B[:, output]
    step = expm(M * draws.hold)
    F, G = step[:N, :N], step[:N, N]
    P = np.zeros((N + 1, N + 1))
    P[:N, :N] = discrete_covariance(F, np.outer(G, G) * draws.variance)
    P[N, N] = draws.variance
    L = np.column_stack([linear.L, np.zeros(linear.L.shape[0])])
    return mean_squares(M, L, draws.hold, P)


def mean_squares(M: np.ndarray, L: np.ndarray, duration: float, P: np.ndarray) -> np.ndarray:
    """The mean over tau from 0 to ``duration`` of diag(L exp(M tau) P exp(M tau)^T L^T), P Hermitian.

    By doubling: the covariance is integrated over a short time by Taylor's series in the Lyapunov operator, and
    S(2h) = S(h) + exp(M h) S(h) exp(M h)^T.
    """
    from scipy.linalg import expm

    size = float(np.linalg.norm(M, 1)) * duration
    halvings = max(0, int(np.ceil(np.log2(size))) + 3) if size > 0 else 0
    h = duration / 2**halvings
    term = P * h
    total = term.copy()
    for k in range(2, 16):  # norm(M) h <= 1/8, so the operator's is at most 1/4: 0.25^15/16! is below rounding
        term = h / k * (M @ term + term @ M.T)
        total = total + term
    for k in range(halvings):
        step = expm(M * (h * 2**k))
        total = total + step @ total @ step.T
    return np.asarray(np.maximum(np.einsum("ij,jk,ik->i", L, total, L).real / duration, 0))


def _delayed_power(linear: Linear, draws: Draws, output: int, delay: float) -> np.ndarray:
    """By the spectrum of held noise, variance hold sinc^2(omega hold/2), since a delay has no finite matrix."""
    if draws.hold is None or not np.isfinite(draws.hold):
        raise NoValue(NEEDS_HOLD)
    slowest = float(np.min(np.abs(np.linalg.eigvals(linear.A).real)))
    lobe = 2 * np.pi / draws.hold
    low = np.logspace(np.log10(slowest * 1e-5), np.log10(max(lobe, 100 * slowest)), 4000)
    fine = np.arange(low[-1], _LOBES * lobe, min(lobe, 2 * np.pi / delay) / 16)
    omega = np.concatenate([[0.0], low, fine[1:]])
    density = draws.variance * draws.hold * np.sinc(0.5 * omega * draws.hold / np.pi) ** 2
    G = np.abs(response(linear, omega, delay)[:, :, output]) ** 2
    return np.asarray(np.trapezoid(G * density[:, None], omega, axis=0) / np.pi)
