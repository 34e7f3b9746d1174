"""What the equations of an observer get, and what they give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from hgorun.errors import KeyPath

Role: TypeAlias = Literal["filter", "gain", "signal"]


@dataclass(frozen=True)
class Flow:
    """The right-hand sides of an observer between measurements.

    Attributes
    ----------
    derivatives : mapping of str to casadi.SX
        d/dt of ``xhat`` and of every state that the observer declares.
    correction : casadi.SX, shape (q,), optional
        c: for each output the term that the equation of its measured state subtracts. The innovation's
        alpha' = -c removes the observer's own correction from the delayed comparison. Left out, it is
        C_x (copy(xhat) - xhat') with C_x = d(C xhat)/dxhat: what xhat' has beside the copy of the plant.
        An observer without such a copy has to give it.
    """

    derivatives: Mapping[str, ca.SX]
    correction: ca.SX | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.derivatives, Mapping):
            kind = type(self.derivatives).__name__
            raise TypeError(f"Flow takes derivatives as {{state: expression}}, such as {{'xhat': ...}}, found {kind}")


@dataclass(frozen=True)
class Sample:
    """What arrives at a sample.

    Attributes
    ----------
    y, previous : casadi.SX, shape (q,)
        This sample and the one before.
    interval : casadi.SX
        The time between them.
    """

    y: ca.SX
    previous: ca.SX
    interval: ca.SX


@dataclass(frozen=True)
class Arrival:
    """Samples that arrive together, of some of the outputs.

    Attributes
    ----------
    y : casadi.SX, shape (q,)
        The newest sample of every output.
    fresh : casadi.SX, shape (q,)
        1 for the outputs whose sample arrives now, 0 for the others.
    """

    y: ca.SX
    fresh: ca.SX


@dataclass(frozen=True)
class SampleSchedule:
    """When an observer that jumps will be called.

    Attributes
    ----------
    intervals : ndarray
        The times between the samples.
    steps : str or None
        The expression of k that gives them, where the configuration has one.
    path : tuple
        Where the sampling stands in the configuration.
    first : float
        When the first sample comes, counted from the start of the run.
    number : int
        That of the sample after which the first of the intervals comes.
    recorded : bool
        Whether the times are those of samples that were recorded, and no configuration says them.
    """

    intervals: np.ndarray
    steps: str | None
    path: KeyPath
    first: float = 0.0
    number: int = 0
    recorded: bool = False


class PeriodLimit(NamedTuple):
    """The longest constant period of sampling at which an observer's error decays.

    Attributes
    ----------
    value : float or None
        None where there is none.
    where : str
        Of which linear system it is the limit, or why there is none.
    """

    value: float | None
    where: str
