"""What theory puts beside a result, to be drawn: transients with their bounds, frequency responses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Transient:
    """An observer's error and its bounds on the output grid, in the coordinates of the theory.

    Attributes
    ----------
    names : tuple of str
        Of the coordinates: the plant's states, or z1..zn.
    time : ndarray, shape (Nt,)
    error : ndarray, shape (Nt, n)
        |zhat - z| of the run.
    bound : ndarray, shape (Nt, n)
        The theorem's.
    sharp : ndarray, shape (Nt, n)
        The same proof's, with nothing given away for a shorter formula.
    holds : bool
        Whether the run meets what the theorem assumes: then neither bound is below the error.
    nominal : ndarray, shape (Nt, n), optional
        chi theta^(i-1) exp(-beta theta (t - t_0)) |e(t_0)|: what the bound comes to without delay, noise and
        disturbance. Where the theorem's assumptions are not met it bounds nothing, and shows what is asked for.
    equation : str
        Of the bound, in the thesis.
    lacking : tuple of str
        What the theorem assumes and the run does not meet.
    """

    names: tuple[str, ...]
    time: np.ndarray
    error: np.ndarray
    bound: np.ndarray
    sharp: np.ndarray
    holds: bool
    nominal: np.ndarray | None = None
    equation: str = ""
    lacking: tuple[str, ...] = ()


@dataclass(frozen=True)
class Bode:
    """Amplitudes of the estimates over that of a sinusoid on the measurement.

    Attributes
    ----------
    omega : ndarray, shape (W,)
        rad per time unit.
    magnitude : dict of str to ndarray, shape (W, n)
        By observer; the largest over outputs.
    states : tuple of str
    own : ndarray
        The frequencies of the configuration's own sinusoids.
    reasons : dict of str to str
        Why an observer is not there.
    """

    omega: np.ndarray
    magnitude: dict[str, np.ndarray]
    states: tuple[str, ...]
    own: np.ndarray
    reasons: dict[str, str]
