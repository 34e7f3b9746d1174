"""How long a correction that is linear for small errors only was something else."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.reasons import NoValue, require_estimate
from hgorun.analysis.subject import Subject
from hgorun.observers.capabilities import LocallyLinear
from hgorun.result.windows import points_in


def _applies(observer: Subject) -> bool:
    return isinstance(observer.observer, LocallyLinear) and observer.observer.nonlinear is not None


@finding(
    "share of the points of `metrics.window` at which a saturation, a zone or the like is active, so that the "
    "correction is not the linear one of norms, margins and predicted noise; for outputs that are continuous and "
    "not late",
    group="noise, measured",
    optional=True,
    applies=_applies,
)
def nonlinear_share(observer: Subject) -> Remarked:
    found, run = observer.found, observer.run
    require_estimate(found)
    if any(not (s.continuous and s.undelayed) for channel in run.channels for s in channel.stretches):
        raise NoValue("the innovation of sampled or late outputs is not kept")
    inside = np.arange(observer.result.time.size)[points_in(observer.result.time, observer.result.windows["steady"])]
    share = float(np.mean(_active(observer, inside)))
    assert isinstance(observer.observer, LocallyLinear)
    if share == 0:
        return Remarked(share, ())
    remark = f"{observer.observer.nonlinear}: {100 * share:.3g} % of metrics.window, where linear theory does not hold"
    return Remarked(share, (remark,))


def _active(observer: Subject, points: np.ndarray) -> np.ndarray:
    """Whether the correction is not linear, at points of the output grid."""
    run, b, result = observer.run, observer.block, observer.result
    linearisation = Linearisation(run, observer.label)
    model, p = run.plant.model, run.structure.plant
    t, z = model.t, ca.SX.sym("z", run.structure.system.states)
    y = ca.SX.sym("y", len(model.outputs))
    u = ca.substitute(run.plant.inputs, model.p, p)
    guess = b.guess(t, u, p, z)
    e = ca.vertcat(*[model.wrapped(k, guess[k] - y[k]) for k in range(y.numel())])
    assert isinstance(b.observer, LocallyLinear)
    active = ca.sum1(b.observer.beyond(b.copy(t, u, p), b.symbols(z), e, b.k)) > 0
    function = ca.Function("active", [t, run.structure.p, z, y], [active])
    states = np.zeros((run.structure.system.states, points.size))
    states[b.start : b.stop] = linearisation.states(observer.found, points).T
    measured = result.measurements.y[points].T
    return np.asarray(function(result.time[points][None], run.numbers.p, states, measured).full()).ravel() > 0.5
