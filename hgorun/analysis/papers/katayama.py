"""What Katayama asks of the reduced-order observers for sampled plants, and how large the error can become.

For x' = f_1 + g z, z' = f_2 with samples y_n = y + n, w(k+1) = (n(k+1) - n(k))/T, and Lipschitz constants as in
section III-A, with l_1 >= |g|, l_2 >= |Phi^-1|, Phi = g^T g. The consistency of the Euler model,
|F^e - F^a| <= T gamma(T), has gamma(T) = (T/2) sup |(x, z)''|; a disturbance
that the observer does not know adds its own norm to it. From

    Psi_n - Psi = Phi_n^-1 g_n^T (w - (f_1n - f_1)) + (Phi_n^-1 g_n^T - Phi^-1 g^T) (g z + rest),  |rest| <= gamma

follow, for p >= |z - Psi_n|,

    p = l_1 l_2 (gamma + |w| + L_1 |n|) + (l_2 L_3 + l_1 L_4) (l_1 |z| + gamma) |n|

    deadbeat (9):  |e| <= T gamma + (1 + T L_2) p + T L_2 |n|

which is (25) with its O(T) written out, and for (8), where e(k+1) = (I - T H) e(k) + T (H (z - Psi_n) + f_2(y, z) -
f_2(y_n, Psi_n)) + T gamma, after the first samples

    reduced_sampled (8):  |e| <= T ((h_max + L_2) p + L_2 |n| + gamma) / (1 - max |1 - T h_i|)

The second does not see that the differences w cancel over time, which is why it is no smaller than the first.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import cast

import casadi as ca
import numpy as np

from hgorun.analysis.papers.region import Points, along, box, evaluated
from hgorun.analysis.reasons import NoValue
from hgorun.observers.reduced_order import ReducedOrder
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.strict_feedback import StrictFeedbackForm

_CONDITION = 1e-10  # of g^T g, relative: below it A2 does not hold


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Of the plant over the box of the run: the largest values at points of it.

    Attributes
    ----------
    L_1, L_2, L_3, L_4, l_1, l_2 : float
    gamma : float
        (T/2) sup |(x, z)''| along the run, for the longest T, and the plant's unknown disturbance.
    z : float
        sup |z| along the run.
    """

    L_1: float
    L_2: float
    L_3: float
    L_4: float
    l_1: float
    l_2: float
    gamma: float
    z: float


@dataclass(frozen=True, kw_only=True)
class KatayamaConditions:
    """Assumptions and bounds.

    Attributes
    ----------
    A2 : bool
        g^T g is nonsingular along the run.
    smallest : float
        The smallest singular value of g along the run.
    A3 : bool
        |1 - T h_i| < 1.
    factors : dict of str to float
        1 - T h_i of every unmeasured state, for the longest T.
    period : float
        The longest time between two samples.
    constants : Constants
    noise, slope : float
        sup |n| and sup |w| of the run.
    bound : float or None
        Of |e| at the samples, from the second half of the run on; None where A2 or A3 fails.
    without_noise : float or None
        The same for n = 0.
    measured : float or None
        sup |e| at the samples of the second half of the run.
    """

    A2: bool
    smallest: float
    A3: bool
    factors: dict[str, float]
    period: float
    constants: Constants
    noise: float
    slope: float
    bound: float | None
    without_noise: float | None
    measured: float | None


def katayama_conditions(run: PreparedRun, label: str, result: Result) -> KatayamaConditions:
    """Conditions and bounds for `reduced_sampled` and `deadbeat`; NoValue for others."""
    observer = run.experiment.observers[label]
    if not isinstance(observer, ReducedOrder):
        raise NoValue("the conditions are for reduced_sampled and deadbeat")
    form = cast(StrictFeedbackForm, run.forms[label])  # the class of plants that these observers are for
    samples = run.channels[0].samples
    arrival = samples.arrival[samples.used]
    steps = np.diff(arrival)
    if not steps.size:
        raise NoValue("there are no two samples")
    T = float(steps.max())
    names = [run.plant.model.states[i] for i in form.hidden]
    rates = observer.rates(form)
    factors = np.zeros(len(names)) if rates is None else 1 - T * rates
    noise, slope = _noise(run, result)
    constants, smallest = _constants(run, form, result, T, noise, slope)
    A2 = smallest > np.sqrt(_CONDITION) * constants.l_1
    A3 = bool(np.all(np.abs(factors) < 1))

    def bound(n: float, w: float) -> float | None:
        if not (A2 and A3):
            return None
        c = constants
        p = _gap(c, n, w)
        if rates is None:  # deadbeat: gone in one step
            return T * c.gamma + (1 + T * c.L_2) * p + T * c.L_2 * n
        # 1 - |1 - T h| is smallest at the longest or the shortest period
        worst = max(float(np.max(np.abs(1 - period * rates))) for period in (T, float(steps.min())))
        return float(T * ((rates.max() + c.L_2) * p + c.L_2 * n + c.gamma) / (1 - worst))

    return KatayamaConditions(
        A2=bool(A2),
        smallest=smallest,
        A3=A3,
        factors=dict(zip(names, map(float, factors), strict=True)),
        period=T,
        constants=constants,
        noise=noise,
        slope=slope,
        bound=bound(noise, slope),
        without_noise=bound(0.0, 0.0),
        measured=_measured(run, form, result, label, arrival),
    )


def _gap(c: Constants, n: float, w: float) -> float:
    """p >= |z - Psi_n|."""
    by_slopes = (c.l_2 * c.L_3 + c.l_1 * c.L_4) * (c.l_1 * c.z + c.gamma) * n
    return c.l_1 * c.l_2 * (c.gamma + w + c.L_1 * n) + by_slopes


def _noise(run: PreparedRun, result: Result) -> tuple[float, float]:
    """sup |n| and sup |w| over the samples of the run."""
    taken, y = result.measurements.taken, result.measurements.y
    whole = np.all(np.isfinite(y), axis=1)
    times, values = taken[whole, 0], y[whole]
    if run.plant.block.discretise:
        truth = np.column_stack([np.interp(times, result.time, column) for column in result.y.T])
    else:
        truth = run.plant_alone.at(times)[0]
    n = values - truth
    if len(n) < 2:
        return float(np.max(np.linalg.norm(n, axis=1), initial=0.0)), 0.0
    w = np.diff(n, axis=0) / np.diff(times)[:, None]
    return float(np.max(np.linalg.norm(n, axis=1))), float(np.max(np.linalg.norm(w, axis=1)))


def _constants(
    run: PreparedRun, form: StrictFeedbackForm, result: Result, T: float, noise: float, slope: float
) -> tuple[Constants, float]:
    """Constants over the box of the run, widened by the noise and by what Psi can differ from z."""
    model = run.plant.model
    measured, hidden = list(form.measured), list(form.hidden)
    path = along(result.time, result.x)
    f, x = model.dynamics, model.x
    low, high = result.x.min(axis=0), result.x.max(axis=0)
    low[measured] -= noise
    high[measured] += noise
    region = box(result.time, low, high)
    g = ca.densify(form.slopes)
    f_1 = ca.substitute(f[measured], x[hidden], ca.SX.zeros(len(hidden)))
    inverse = ca.inv(g.T @ g)

    def largest(expression: ca.SX, points: Points) -> float:
        """Of the spectral norms; of a matrix's slope the norm with the matrix as a vector is a bound."""
        values = evaluated(run, expression, x, points)
        return float(np.max(np.linalg.norm(values, 2, axis=(1, 2)), initial=0.0))

    def slope_of(expression: ca.SX, by: list[int], points: Points) -> float:
        return largest(ca.jacobian(ca.vec(expression), x[by]), points)

    smallest = float(np.min(np.linalg.svd(evaluated(run, g, x, path), compute_uv=False)[:, -1]))
    if not smallest > 0:
        return Constants(**dict.fromkeys((f.name for f in fields(Constants)), float("nan"))), smallest
    second = ca.jtimes(f, x, f) + ca.jacobian(ca.substitute(f, model.u, run.plant.inputs), model.t)
    gamma = T / 2 * largest(second, path) + largest(run.plant.disturbance, path)
    z = float(np.max(np.linalg.norm(result.x[:, hidden], axis=1)))
    first = Constants(
        L_1=slope_of(f_1, measured, region),
        L_2=0.0,
        L_3=slope_of(g, measured, region),
        L_4=slope_of(inverse, measured, region),
        l_1=largest(g, region),
        l_2=largest(inverse, region),
        gamma=gamma,
        z=z,
    )
    gap = _gap(first, noise, slope)
    low[hidden] -= gap
    high[hidden] += gap
    wide = box(result.time, low, high)
    L_2 = max(slope_of(f[hidden], measured, wide), slope_of(f[hidden], hidden, wide))
    return Constants(
        L_1=first.L_1, L_2=L_2, L_3=first.L_3, L_4=first.L_4, l_1=first.l_1, l_2=first.l_2, gamma=gamma, z=z
    ), smallest


def _measured(
    run: PreparedRun, form: StrictFeedbackForm, result: Result, label: str, arrival: np.ndarray
) -> float | None:
    """sup |e| at the output points that are samples, in the second half of the run."""
    hidden = list(form.hidden)
    middle = 0.5 * (result.time[0] + result.time[-1])
    late = arrival[arrival >= middle]
    at = np.clip(np.searchsorted(result.time, late), 0, result.time.size - 1)
    at = np.where((at > 0) & (np.abs(result.time[at - 1] - late) < np.abs(result.time[at] - late)), at - 1, at)
    hit = np.abs(result.time[at] - late) < 1e-9 * run.span
    e = (result.observers[label].xhat - result.x)[at[hit]][:, hidden]
    if not len(e) or not np.all(np.isfinite(e)):
        return None
    return float(np.max(np.linalg.norm(e, axis=1)))
