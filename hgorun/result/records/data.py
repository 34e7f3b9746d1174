"""The result of a run: trajectories, measurements, metrics."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from hgorun.config.named import Named, name_keys
from hgorun.errors import printable
from hgorun.result.records.closed import ClosedLoop
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import Recorded
from hgorun.result.records.status import OK, Status, Verdict, worst


@dataclass(frozen=True, eq=False)
class Measurements:
    """What the observers got.

    Attributes
    ----------
    time : ndarray, shape (Nk,)
        When each measurement became available: arrival times of samples, the output grid where an output
        is continuous.
    taken, y : ndarray, shape (Nk, q)
        The time it was measured, and the noisy value; NaN where an output has none.
    every : int
        Of so many samples of an output one is kept, the first, where a run is too long for all of them.
    """

    time: np.ndarray
    taken: np.ndarray
    y: np.ndarray
    every: int = 1

    @classmethod
    def nothing(cls, outputs: int) -> Measurements:
        """Where what was measured is not simulated."""
        return cls(np.zeros(0), np.zeros((0, outputs)), np.zeros((0, outputs)))

    def since(self, origin: float) -> Measurements:
        """The same, counted from some time on."""
        return replace(self, time=self.time - origin, taken=self.taken - origin)


@dataclass(frozen=True, eq=False)
class DesignNumbers:
    """The numbers that a run was carried out with, as far as they follow from its configuration.

    Some of them, such as gains and the automatic step, are computed by libraries whose last bits depend on the machine.
    A run with these has the same bits everywhere.

    Attributes
    ----------
    parameters : ndarray, shape (p,)
        Of the plant, of signals and of the observers' designs, in the order of the equations.
    start : ndarray, shape (states,)
        All states at the start.
    step : float
        The nominal step.
    """

    parameters: np.ndarray
    start: np.ndarray
    step: float


PLANT = "plant"  # beside the labels of observers, none of which is called so


@dataclass(frozen=True, eq=False)
class IntegrationError:
    """How far the numbers of a run may be from those of the exact solution of its equations.

    Attributes
    ----------
    relative : mapping of str to float
        For ``plant`` and every observer.
    unresolved : mapping
        ``{label: {metric: states}}``: the times that the integration does not resolve, since the estimate is less
        certain than the bound that its error settles below.
    """

    relative: Mapping[str, float]
    unresolved: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name_keys(self, relative=f"observer (or {PLANT})", unresolved="observer with unresolved times")

    def without(self, labels: Collection[str]) -> IntegrationError:
        """Of the others."""
        return IntegrationError(
            {label: error for label, error in self.relative.items() if label not in labels},
            {label: of for label, of in self.unresolved.items() if label not in labels},
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Integration:
    """How the equations were integrated, and how far that may be from their solution.

    Attributes
    ----------
    method : str or None
        None, like all but the error, in files of older versions.
    step : float or None
        The longest step, where steps are fixed.
    rtol : float or None
        The relative tolerance, where errors control the steps.
    evaluations : int or None
        Of the right-hand side, over all passes but that which is made for the estimate alone.
    error : IntegrationError or callable
        The estimated error, or what makes it when it is asked for.
    longest_gap : float or None
        The longest time between two events, at which steps end; None where that is not known, as of files.
    """

    method: str | None
    step: float | None
    rtol: float | None
    evaluations: int | None
    error: IntegrationError | Callable[[], IntegrationError] = field(repr=False)
    longest_gap: float | None = None

    def told(self) -> dict[str, str | float | int | None]:
        """What files keep of it besides the error."""
        return {"method": self.method, "step": self.step, "rtol": self.rtol, "evaluations": self.evaluations}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ResultData:
    """A finished run.

    Attributes
    ----------
    name, title : str
    time : ndarray, shape (Nt,)
    x, u, y : ndarray, shapes (Nt, n), (Nt, m), (Nt, q)
        Plant states, inputs and noise-free outputs.
    states, inputs, outputs : tuple of str
    units : mapping of str to str
        Of time ("time"), states, outputs and inputs, where known.
    measurements : Measurements
    observers : dict of str to ObserverResult
    config : str
        The YAML text as written.
    resolved : str or callable
        The YAML text after ``extends``, ``--set`` and defaults, or what makes it when it is asked for.
    windows : mapping
        The windows that the metrics were taken from.
    measures : mapping of str to str, optional
        The outputs that are states, with the states that they are; None in files that do not say.
    integration : Integration, optional
        How the equations were integrated; None in files that do not say.
    remarks : tuple of str
        What should be known of the run, such as functions of time whose kinks may have been missed.
    verdict : Verdict
        Whether the plant's numbers can be trusted, and why not.
    design : DesignNumbers, optional
        None in files of older versions, and of recorded data.
    recorded : Recorded, optional
        What recorded data an estimate was made of. There is no truth then: x and y have no columns.
    closed_loop : mapping of str to ClosedLoop
        Where a controller drives the plant: by observer the plant that its estimates drive, and under ``plant`` the
        one that the true state drives, which x, u, y and the measurements are of. Else empty.
    last : float
        The time of the last point, where the trajectories are in a file and none of them is here.
    """

    name: str
    title: str
    time: np.ndarray
    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    measurements: Measurements
    observers: Mapping[str, ObserverResult]
    config: str
    resolved: str | Callable[[], str]
    seed: int
    windows: Mapping[str, Any] = field(default_factory=dict)
    integration: Integration | None = None
    measures: Mapping[str, str] | None = None
    remarks: tuple[str, ...] = ()
    verdict: Verdict = OK
    design: DesignNumbers | None = None
    recorded: Recorded | None = None
    closed_loop: Mapping[str, ClosedLoop] = field(default_factory=dict)
    last: float = math.nan

    def __post_init__(self) -> None:
        name_keys(self, observers="observer", closed_loop="observer with a controller")

    @property
    def end(self) -> float:
        """The time of the last point."""
        return float(self.time[-1]) if self.time.size else self.last

    def truth_of(self, label: str | None) -> np.ndarray:
        """What an observer estimates, shape (Nt, n): the plant, or in a closed loop the one that it drives."""
        return self.x if label is None or not self.closed_loop else self.closed_loop[label].x

    @property
    def kind(self) -> Literal["simulation", "estimate"]:
        """Of a simulated plant, or of recorded data."""
        return "simulation" if self.recorded is None else "estimate"

    def outputs_of(self, state: str) -> tuple[str, ...]:
        """The outputs that measure a state: those that are it, whatever their names."""
        measures = {name: name for name in self.outputs} if self.measures is None else self.measures
        return tuple(name for name in self.outputs if measures.get(name) == state)

    @cached_property
    def config_resolved(self) -> str:
        """The YAML text after ``extends``, ``--set`` and defaults, without figures, claims and titles."""
        return self.resolved if isinstance(self.resolved, str) else self.resolved()

    @cached_property
    def integration_error(self) -> Mapping[str, float] | None:
        """Estimated error of the integration, for ``plant`` and every observer; None where it is not known.

        For an observer the largest of its metrics, each relative to its own size, or to 1e-6 of the largest value of
        the state; for the plant that of its states, relative to their largest values.
        """
        return None if self._errors is None else self._errors.relative

    @property
    def unresolved(self) -> Mapping[str, Mapping[str, tuple[str, ...]]]:
        """The times among the metrics that the integration does not resolve: ``{label: {metric: states}}``."""
        return {} if self._errors is None else self._errors.unresolved

    @cached_property
    def _errors(self) -> IntegrationError | None:
        if self.integration is None:
            return None
        error = self.integration.error
        return error() if callable(error) else error

    def __repr__(self) -> str:
        labels = ", ".join(self.observers) or "no observers"
        return f"<Result {self.name!r}: {labels}; {self.time.size} points; {self.status}>"

    @property
    def status(self) -> Status:
        """The worst status of the plant and its observers."""
        return worst([self.verdict, *(o.verdict for o in self.observers.values())])

    def troubles(self) -> list[str]:
        """Who is not ok, when, and why: ``observer SHGO diverged at t=1.25 s: ...``."""
        said = {"plant": self.verdict} | {f"observer {label}": o.verdict for label, o in self.observers.items()}
        unit = printable(self.units.get("time", ""))
        return [f"{who} {verdict.sentence(unit)}" for who, verdict in said.items() if verdict.status != "ok"]

    def metrics(self) -> dict[str, dict[str, dict[str, float]]]:
        """{observer: {metric: {state: number}}}."""
        return Named({label: self._metrics_of(o) for label, o in self.observers.items()}, "observer")

    def _metrics_of(self, observer: ObserverResult) -> dict[str, dict[str, float]]:
        """{metric: {state: number}}; of recorded data there are none, but scores."""
        metrics = {
            name: Named(dict(zip(self.states, map(float, values), strict=True)), "state")
            for name, values in observer.metrics.items()
        }
        what = "metric" if observer.assessed is None else "metric (recorded data have assessed.scores)"
        return Named(metrics, what)
