"""What a result has of one observer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np

from hgorun.config.named import name_keys
from hgorun.result.records.recorded import Assessed
from hgorun.result.records.status import OK, Status, Verdict

MapName = Literal["chain", "derivatives"]
_ESTIMATE = ("x", "x_hat", "xh", "estimate", "estimates", "state", "states")  # what others call it
MAPS: tuple[MapName, ...] = ("chain", "derivatives")


@dataclass(frozen=True)
class Coordinates:
    """The coordinates in which a constant gain corrects, as the keys ``map`` and ``chains`` choose them.

    Attributes
    ----------
    map : str
        ``chain`` or ``derivatives``.
    chains : mapping of str to int
        Length of every output's chain.
    """

    map: MapName
    chains: Mapping[str, int]

    def __str__(self) -> str:
        return f"{self.map} ({', '.join(f'{name}: {length}' for name, length in self.chains.items())})"


@dataclass(frozen=True, kw_only=True, eq=False)
class ObserverResult:
    """One observer's trajectories.

    Attributes
    ----------
    xhat : ndarray, shape (Nt, n)
        The estimate in the plant's coordinates; NaN from where it is lost.
    internal : dict of str to ndarray, shape (Nt, ...)
        Internal states in their own shapes.
    gains : dict
        The numbers that the observer used.
    dimension : int
        Number of its differential equations.
    verdict : Verdict
        Whether its numbers can be trusted, and why not.
    metrics : dict of str to ndarray, shape (n,)
        Infinite where the estimate is lost.
    coordinates : Coordinates, optional
        Where a constant gain corrects; None for other observers, and for files that do not say.
    assessed : Assessed, optional
        Of an estimate of recorded data.
    unestimated : tuple of str
        States of which the observer says nothing; not in files of older versions.
    """

    type: str
    xhat: np.ndarray
    internal: Mapping[str, np.ndarray]
    gains: Mapping[str, Any]
    dimension: int
    verdict: Verdict = OK
    metrics: Mapping[str, np.ndarray] = field(default_factory=dict)
    coordinates: Coordinates | None = None
    assessed: Assessed | None = None
    unestimated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        name_keys(self, internal="internal state", gains="gain", metrics="metric")

    if not TYPE_CHECKING:  # a type checker would take any name for one of these

        def __getattr__(self, name: str) -> NoReturn:
            meant = "; the estimate is `xhat`" if name in _ESTIMATE else ""
            raise AttributeError(f"the result of an observer has no {name!r}{meant}", name=name, obj=self)

    @property
    def filter_order(self) -> int | None:
        """Order of the filter with state eta; None where the observer has none."""
        eta = self.internal.get("eta")
        return None if eta is None else int(np.prod(eta.shape[1:2]))

    @property
    def status(self) -> Status:
        """``ok``, ``inaccurate``, ``diverged``, ``undefined`` or ``failed``."""
        return self.verdict.status

    @property
    def status_at(self) -> float | None:
        """The time that the status is about, where there is one."""
        return self.verdict.at

    @property
    def reason(self) -> str | None:
        """Why the status is not ``ok``, where that is known."""
        return self.verdict.reason

    @property
    def diverged_at(self) -> float | None:
        """When it diverged; None where it did not."""
        return self.verdict.at if self.status == "diverged" else None

    @cached_property
    def lost(self) -> bool:
        """Whether the estimate ends before the run does, so that metrics are infinite."""
        return self.verdict.lost or not bool(np.all(np.isfinite(self.xhat)))
