"""What the convergence theory of one observer starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hgorun.analysis.convergence import peaking
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.charts import Chart, chart_of
from hgorun.analysis.convergence.gains import GAINS, ErrorDynamics
from hgorun.analysis.convergence.lipschitz import Lipschitz, lipschitz
from hgorun.analysis.convergence.signals import Amplitudes, amplitudes
from hgorun.analysis.findings import Context
from hgorun.observers.riccati import RiccatiGain
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.triangular import TriangularForm
from hgorun.analysis.reasons import NoValue

_FINE = 0.5  # of the fastest time constant: the output grid shows a transient whose steps are shorter
_RICCATI = 5.0
_MORE = 1.5  # than the bound on a transient without delay: that with one is a little larger


@dataclass(frozen=True)
class Setting:
    """An observer of a run with its chart, slopes and disturbances.

    Attributes
    ----------
    context : Context
    block : ObserverBlock
    chart : Chart
    lipschitz : Lipschitz
    amplitudes : Amplitudes
    reach : ndarray or None
        How far the estimate may go, where the output grid does not show it.
    """

    context: Context
    block: ObserverBlock
    chart: Chart
    lipschitz: Lipschitz
    amplitudes: Amplitudes
    reach: np.ndarray | None

    @property
    def theta(self) -> float:
        return float(self.block.observer.theta)  # type: ignore[attr-defined]

    @property
    def start(self) -> dict[str, np.ndarray]:
        return _start(self.context, self.block, self.chart)


def _start(context: Context, block: ObserverBlock, chart: Chart) -> dict[str, np.ndarray]:
    """Errors and internal states at the start, flat, by name."""
    observer = context.result.observers[block.label]
    error = chart.image(observer.xhat[:1]) - chart.image(context.run.plant.initial[None])
    found = {"xhat": error[0]}
    for name, state in block.states.items():
        if name not in ("xhat", "alpha", *GAINS) and state.size:
            found[name] = np.ravel(state.numbers(np.asarray(observer.internal[name][0])))
    return found


def setting_of(context: Context, block: ObserverBlock, dynamics: ErrorDynamics | None) -> Setting:
    """The setting of an observer, whose error dynamics are given where they are known.

    Raises
    ------
    NoValue
    """
    if block.observer.discrete:
        raise NoValue(f"{block.observer.type} is a difference equation, the theorems are of flows")
    if not hasattr(block.observer, "theta"):
        raise NoValue(f"{block.observer.type} has no constant theta")
    run, result = context.run, context.result
    chart = chart_of(block.form, run.plant)
    own = isinstance(block.form, TriangularForm) or chart.own
    saturation = {name: (low, high) for name, (low, high) in block.observer.saturation.items()} if own else {}
    a = amplitudes(run, chart, result)
    reach = None
    bounded = dynamics is not None and dynamics.certificate.hurwitz and isinstance(block.form, CanonicalForm)
    if dynamics is not None and bounded and coarse(context, block):
        reach = _reach(dynamics, _start(context, block, chart), float(block.observer.theta), a)
    found = lipschitz(run, chart, saturation, result, block.label, reach)
    return Setting(context, block, chart, found, a, reach)


def coarse(context: Context, block: ObserverBlock) -> bool:
    """Whether a transient fits between two points of the output grid."""
    time, observer = context.result.time, block.observer
    # a Riccati gain's own rate is that of the peaks of P, the error's a few theta
    rate = _RICCATI * observer.theta if isinstance(observer, RiccatiGain) else observer.fastest_rate(block.form)
    return bool(time.size < 2 or (time[1] - time[0]) * rate > _FINE)


def _reach(dynamics: ErrorDynamics, start: Mapping[str, np.ndarray], theta: float, a: Amplitudes) -> np.ndarray:
    """How far the theorem lets an estimate go, whatever the Lipschitz constant with which it holds; 50 % more."""
    certificate = dynamics.certificate
    rate = Halanay(certificate.beta * theta, 0.0)
    undelayed = replace(a, delay=0.0)
    first = np.concatenate(list(start.values()))
    course = peaking.sharp_course(dynamics, certificate, rate, first, theta, undelayed)
    return np.asarray(_MORE * (weights(dynamics, theta) * course.at(np.zeros(1))).ravel())


def weights(dynamics: ErrorDynamics, theta: float) -> np.ndarray:
    """theta^(i-1) sqrt((P^-1)_ii): what sqrt V is to the i-th error, shape (n, 1)."""
    each = np.sqrt(np.diag(np.linalg.inv(dynamics.certificate.P)))
    return np.asarray((each / dynamics.scale(theta))[: dynamics.n, None])
