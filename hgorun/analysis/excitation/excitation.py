"""Whether a run excites a plant that is observable under some inputs only: which state is not seen, and when.

The time-varying observers ask for a Gramian bounded from below, Robles Magdaleno 2023, (2.43), (3.86), (3.101);
see :mod:`hgorun.analysis.excitation.gramian`. Of its bound delta* follows one for the observer's own Riccati equation,
S = P^-1 >= exp(-T*) delta* I, which assumption A4 asks for (2.40) and which is looked at beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import casadi as ca
import numpy as np

from hgorun.analysis.excitation.gramian import Links, gramians, seen
from hgorun.analysis.linear.coordinates import transformed
from hgorun.analysis.reasons import NoValue
from hgorun.observers.capabilities import FilterOrder
from hgorun.observers.riccati import RiccatiGain
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.forms import BlockForm
from hgorun.symbolic.triangular import TriangularCopy

HORIZONS = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0])  # T* tried where none is given
_POINTS = 1_000, 6_000  # fewest and most times
_WEAK = 0.01  # of what links of 1 give: less counts as not excited
_NAMED = 3  # stretches of time that are named in words
_UNIFORM = "uniformly observable: no excitation needed"


@dataclass(frozen=True)
class Weakness:
    """A stretch of time in which the output does not show a state.

    Attributes
    ----------
    state : str
    start, end : float
    seen : float
        The smallest 1/(W^-1)_ii there, over what links of 1 give.
    """

    state: str
    start: float
    end: float
    seen: float


@dataclass(frozen=True)
class Eigenvalues:
    """Of the observer's own matrix along the run, from t* = start + T*/theta on (assumption A4).

    Attributes
    ----------
    name : str
        P or S.
    smallest, largest : float
    largest_at, smallest_at : float
        Times.
    rho : float
        The smallest eigenvalue of S, or of P^-1: rho*/alpha(theta) in (2.40). Behind a filter the reduced
        equations carry a block P of S^-1, and this is a bound from above.
    """

    name: str
    smallest: float
    smallest_at: float
    largest: float
    largest_at: float
    rho: float


@dataclass(frozen=True, kw_only=True)
class Excitation:
    """How much a run excites the plant.

    Attributes
    ----------
    condition : str
        The inequality, by its number.
    horizon : float
        T*: the window is T*/theta long.
    delta : float
        The largest delta* (rho_0/alpha) that the run allows at this T*.
    at : float
        Where the Gramian is smallest.
    reference : float
        delta* of the same model with every link equal to 1.
    weights : dict of str to float
        The eigenvector there: how much of each state is not seen. Of states of a filter too.
    state : str
        The largest of them among the plant's states.
    weak : tuple of Weakness
        When each of the plant's states is seen less than 1 % as well as with links of 1, whatever the others
        are: 1/(W^-1)_ii for state i.
    rho_bound : float
        exp(-T*) delta*: what theory promises for the smallest eigenvalue of S.
    eigenvalues : Eigenvalues or None
    words : str
    """

    condition: str
    horizon: float
    delta: float
    at: float
    reference: float
    weights: dict[str, float]
    state: str
    weak: tuple[Weakness, ...]
    rho_bound: float
    eigenvalues: Eigenvalues | None
    words: str


def excitation(run: PreparedRun, label: str, result: Result, horizon: float | None = None) -> Excitation:
    """Excitation along a run, as the observer's theorem asks for it.

    Parameters
    ----------
    run : PreparedRun
    label : str
        Of the observer.
    result : Result
    horizon : float, optional
        T*, a multiple of 1/12. Where it is omitted, that of ``HORIZONS`` which promises most for S, with a
        window not longer than a third of the run.

    Raises
    ------
    NoValue
        Where none is needed, or the run is too short.

    Notes
    -----
    (2.43) is along the estimate, (3.101) along the plant's state. r integrators stand before the plant in
    (3.101), which is what `fhgo2_nuos` needs; for r = 0 it is (3.86).
    """
    observer = run.experiment.observers[label]
    if not isinstance(observer, RiccatiGain):
        raise NoValue(_UNIFORM)
    found = result.observers[label]
    names = _names(run, label)
    filtered = isinstance(observer, FilterOrder)
    r = observer.r if isinstance(observer, FilterOrder) else 0
    x = result.x if filtered or found.lost else found.xhat
    links = links_along(run, label, result.time, x)
    condition = f"(3.101), r = {r}" if r else "(3.86)" if filtered else "(2.43)"
    look = _look(links.behind_integrators(r), observer.theta, horizon, condition, names, run.origin)
    after = run.origin + float(links.times[0]) + look.horizon / observer.theta
    return replace(look, eigenvalues=_eigenvalues(found, run.origin + links.times, after))


def plant_excitation(run: PreparedRun, label: str, result: Result, horizon: float | None = None) -> Excitation:
    """(3.86), without the filter's integrators, along the plant's state."""
    observer = run.experiment.observers[label]
    if not isinstance(observer, RiccatiGain):
        raise NoValue(_UNIFORM)
    links = links_along(run, label, result.time, result.x)
    names = _names(run, label)
    return _look(links, observer.theta, horizon, "(3.86)", names, run.origin)


def links_along(run: PreparedRun, label: str, times: np.ndarray, x: np.ndarray) -> Links:
    """F and C of a triangular model along states x (Nt, n) in the plant's coordinates."""
    form = _form(run, label)
    plant, model = run.plant, form.model
    t, p = model.t, model.p
    copy = cast(TriangularCopy, form.copy(t, plant.inputs, p, False, {}))  # what every RiccatiGain is for
    own = transformed(form, x, plant.parameters)
    symbolic = copy.F(model.x)
    F = ca.Function("F", [t, model.x, p], [ca.densify(symbolic)])
    present = np.asarray(ca.DM(symbolic.sparsity(), 1.0).full()) > 0
    values = np.asarray(F(ca.DM(times[None, :]), ca.DM(own.T), ca.DM(plant.parameters)).full())
    stacked = values.reshape(model.n, times.size, model.n).swapaxes(0, 1)
    return Links(times, np.ascontiguousarray(stacked), np.asarray(copy.C.full()), present)


def _names(run: PreparedRun, label: str) -> list[str]:
    return list(_form(run, label).model.states)


def _form(run: PreparedRun, label: str) -> BlockForm:
    form = run.forms[label]
    assert isinstance(form, BlockForm)
    return form


def _look(
    links: Links, theta: float, horizon: float | None, condition: str, states: Sequence[str], origin: float
) -> Excitation:
    """Excitation of a model with these states, behind as many integrators as it has more, without an observer's own."""
    filters = links.n - len(states)
    names = [*(f"eta{i + 1}" for i in range(filters)), *states]
    start, end = float(links.times[0]), float(links.times[-1])
    horizons = HORIZONS[HORIZONS / theta <= (end - start) / 3] if horizon is None else np.array([horizon])
    if not horizons.size or horizons[-1] / theta >= end - start:
        raise NoValue("the run is shorter than the window of the Gramian")
    at = _times(start + horizons[-1] / theta, end, horizons[0] / theta)
    W = gramians(links, at, theta, horizons)
    values = np.linalg.eigvalsh(W)[..., 0]
    best = int(np.argmax(np.exp(-horizons) * values.min(axis=1)))
    T, one = float(horizons[best]), horizons[best : best + 1]
    lowest = float(at[np.argmin(values[best])])
    around = np.linspace(max(lowest - (at[1] - at[0]), at[0]), min(lowest + (at[1] - at[0]), end), 41)
    closer = gramians(links, around, theta, one)[0]
    eigenvalues, vectors = np.linalg.eigh(closer)
    i = int(np.argmin(eigenvalues[:, 0]))
    delta = max(float(eigenvalues[i, 0]), 0.0)
    weights = dict(zip(names, map(float, np.abs(vectors[i, :, 0])), strict=True))
    unbroken = gramians(links.unbroken(), at[:1], theta, one)[0]
    reference = float(np.linalg.eigvalsh(unbroken[0])[0])
    ratios = (seen(W[best]) / seen(unbroken))[:, filters:]
    told = origin + at
    weak = tuple(w for i, name in enumerate(states) for w in _weak(told, ratios[:, i], name, T / theta))
    state = max(states, key=lambda name: weights[name])
    words = _words(weak, told, delta, reference, state, origin + float(around[i]))
    rho = float(np.exp(-T) * delta)
    return Excitation(
        condition=condition,
        horizon=T,
        delta=delta,
        at=origin + float(around[i]),
        reference=reference,
        weights=weights,
        state=state,
        weak=weak,
        rho_bound=rho,
        eigenvalues=None,
        words=words,
    )


def _times(first: float, last: float, window: float) -> np.ndarray:
    """A quarter of the shortest window apart."""
    count = int(np.clip(np.ceil((last - first) / window * 4), *_POINTS))
    return np.linspace(first, last, count)


def _weak(at: np.ndarray, ratio: np.ndarray, name: str, window: float) -> list[Weakness]:
    """The stretches in which a state is not seen; those less than a window apart are one."""
    below = np.flatnonzero(ratio < _WEAK)
    if not below.size:
        return []
    parts = np.split(below, np.flatnonzero(np.diff(at[below]) > window) + 1)
    return [Weakness(name, float(at[p[0]]), float(at[p[-1]]), float(ratio[p].min())) for p in parts]


def _eigenvalues(found: ObserverResult, times: np.ndarray, after: float) -> Eigenvalues | None:
    name = next((n for n in ("P", "S") if n in found.internal), None)
    if name is None:
        return None
    matrices = np.asarray(found.internal[name])
    chosen = (times >= after) & np.all(np.isfinite(matrices), axis=(1, 2))
    if not chosen.any():
        return None
    values = np.linalg.eigvalsh(matrices[chosen])
    t = times[chosen]
    low, high = int(np.argmin(values[:, 0])), int(np.argmax(values[:, -1]))
    smallest, largest = float(values[low, 0]), float(values[high, -1])
    rho = 1 / largest if name == "P" else smallest
    return Eigenvalues(name, smallest, float(t[low]), largest, float(t[high]), rho)


def _words(weak: Sequence[Weakness], at: np.ndarray, delta: float, reference: float, state: str, lowest: float) -> str:
    """Which state is not seen, and when."""
    if not weak:
        return (
            f"every state is seen in the output throughout; least {state}, at t = {lowest:.4g}, with "
            f"{delta / reference:.2g} of what links of 1 would give"
        )
    sentences = []
    for name in dict.fromkeys(w.state for w in weak):
        own = [w for w in weak if w.state == name]
        longest = sorted(own, key=lambda w: w.start - w.end)[:_NAMED]
        spans = ", ".join(f"[{w.start:.4g}, {w.end:.4g}]" for w in sorted(longest, key=lambda w: w.start))
        if len(own) == 1 and own[0].start <= at[0] and own[0].end >= at[-1]:
            sentences.append(f"{name} is not seen in the output at any time")
            continue
        total = (sum(w.end - w.start for w in own) + len(own) * (at[1] - at[0])) / (at[-1] - at[0])
        times = f"for t in {spans}" if len(own) <= _NAMED else f"{len(own)} times, longest for t in {spans}"
        sentences.append(f"{name} is hardly seen in the output {times} ({100 * total:.2g} % of the time)")
    return "; ".join(sentences)
