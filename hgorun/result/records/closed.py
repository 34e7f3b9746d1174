"""What a run has of plants that a controller drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.config.named import name_keys


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ClosedLoop:
    """A plant that a controller drives, with an observer's estimates or with its true state.

    Attributes
    ----------
    x, u, y : ndarray, shapes (Nt, n), (Nt, m), (Nt, q)
        Its states, inputs and noise-free outputs; NaN from where it is lost.
    integral : mapping of str to ndarray, shape (Nt,)
        The integrals of the controller.
    effort : ndarray, shape (m,)
        The integral of the square of every input over the run; infinite, like peak and cost, where the loop is lost.
    peak_input : ndarray, shape (m,)
        The largest absolute value of every input, at the points of the metrics.
    cost : float or None
        The integral of the controller's cost over the run; None where it has none.
    """

    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    integral: Mapping[str, np.ndarray]
    effort: np.ndarray
    peak_input: np.ndarray
    cost: float | None = None

    def __post_init__(self) -> None:
        name_keys(self, integral="integral of the controller")
