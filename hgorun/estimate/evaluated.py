"""What of a run is compared with measurements: estimates at the times of samples, and between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from hgorun.data.recording import Signal
from hgorun.estimate.carrying import Carried, carry_out, estimates
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.lag import behind
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.levels import distinct

_PIECE = 1 << 15  # samples at a time: there may be many
_LITTLE = 1e-6  # of the shortest time between samples


@dataclass(frozen=True, eq=False, repr=False)
class Compared:
    """A measured quantity beside what every observer says of it.

    Attributes
    ----------
    name : str
        A state or an output.
    taken, values : ndarray, shape (k,)
        Times counted from the start of the run.
    residuals : ndarray, shape (m, k)
        Measured minus estimated, without whole periods.
    """

    name: str
    taken: Floats
    values: Floats
    residuals: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Normal:
    """What an observer knows of its own errors.

    Attributes
    ----------
    deviation : ndarray, shape (Nt, n)
        Their standard deviation on the output grid.
    nis : list of ndarray, shape (n_k,) each
        Of every output the innovations squared over their variance.
    aside : mapping of str to ndarray, shape (k,)
        By what was held out, the standard deviation of each residual: of a sample of an output with its noise, NaN
        where that is not known; of a state that is no output without any.
    """

    deviation: Floats
    nis: list[Floats]
    aside: Mapping[str, Floats]


class Innovations(Protocol):
    """Of an output measured minus estimated at the time of each sample, as it was estimated without that sample."""

    def of(self, j: int, some: slice = slice(None)) -> Floats:
        """Those of observer j, of some samples."""


@dataclass(frozen=True, eq=False, repr=False)
class InnovationsInMemory:
    """Innovations of a run that is carried out at once.

    Attributes
    ----------
    values : ndarray, shape (m, n_k)
    """

    values: Floats

    def of(self, j: int, some: slice = slice(None)) -> Floats:
        """Those of observer j, of some samples, which are not to be changed."""
        return self.values[j, some]


@dataclass(frozen=True, eq=False, repr=False)
class Evaluated:
    """A run, its estimates on the output grid, and what they are compared with.

    Attributes
    ----------
    carried : Carried
    grid : ndarray, shape (Nt,)
        The output grid, from 0 on.
    xhat : sequence of ndarray, shape (Nt, n)
        Of every observer.
    rows : ndarray, shape (Nt, states)
    predicted : sequence of Innovations
        Of every output.
    held_out, reference : mapping of str to Compared
    normal : sequence of Normal or None
        Of every observer what it knows of its own errors.
    undefined : ndarray, shape (m,)
        From when on an estimate is no number; infinite where it always is one.
    """

    carried: Carried
    grid: Floats
    xhat: Sequence[Floats]
    rows: Floats
    predicted: Sequence[Innovations]
    held_out: Mapping[str, Compared]
    reference: Mapping[str, Compared]
    normal: Sequence[Normal | None]
    undefined: Floats


def evaluate_run(
    prepared: PreparedEstimate,
    held_out: Mapping[str, Signal],
    reference: Mapping[str, Signal],
    *,
    with_error: bool = True,
) -> Evaluated:
    """Carry a run out and compare it with what was not used in it.

    Parameters
    ----------
    held_out : mapping of str to Signal
        By output.
    reference : mapping of str to Signal
        By state or output.
    with_error : bool
        Whether the error of the integration is wanted where nothing depends on it: the step is given.
    """
    experiment = prepared.experiment
    origin, end = experiment.origin, experiment.time.end
    asked = {(0, name): signal for name, signal in held_out.items()}
    asked |= {(1, name): signal for name, signal in reference.items()}
    chosen = {key: inside(signal, origin, end) for key, signal in asked.items()}
    grid, _, _ = experiment.grid
    every = experiment.grid[1]
    shown = grid[::every]
    late = [one.taken for one in prepared.samples if one.taken is not one.available]
    covariances = prepared.covariances()
    before = [_judged(one) for one in prepared.samples] if any(covariances) else []
    times = distinct(np.concatenate([shown, *(taken for taken, _ in chosen.values()), *late, *before]))
    carried = carry_out(prepared, times, with_error=with_error)
    everywhere = estimates(prepared, times, carried.raw) if carried.xhat is None else carried.xhat
    # where nothing is compared in between, no copies are made
    on_grid = slice(None) if times.size == shown.size else np.searchsorted(times, shown)
    compared = {
        key: compared_with(prepared, key[1], taken, values, [x[np.searchsorted(times, taken)] for x in everywhere])
        for key, (taken, values) in chosen.items()
    }
    compared = {key: with_lag(prepared, one, asked[key].lag) for key, one in compared.items()}
    predicted = [innovations_of(prepared, i, times, everywhere, carried) for i in range(len(prepared.samples))]
    aside = {name: one for (which, name), one in compared.items() if which == 0}
    rows = carried.raw.rows[:, :, 0]
    normal = [
        None if one is None else _normal(prepared, one, rows, times, shown, before, predicted, aside, j)
        for j, one in enumerate(covariances)
    ]
    return Evaluated(
        carried,
        shown,
        [x[on_grid] for x in everywhere],
        carried.raw.rows[on_grid, :, 0],
        [InnovationsInMemory(one) for one in predicted],
        aside,
        {name: one for (which, name), one in compared.items() if which == 1},
        normal,
        np.array([first_undefined(shown, x[on_grid]) for x in everywhere]),
    )


def first_undefined(grid: Floats, xhat: Floats) -> float:
    """The first time at which an estimate is no number; infinite without one."""
    columns = [xhat.ravel()] if xhat.flags.c_contiguous else xhat.T
    if all(np.isfinite(column).all() for column in columns):  # which is told in much less time than of every row
        return np.inf
    bad = np.flatnonzero(~np.all(np.isfinite(xhat), axis=1))
    return float(grid[bad[0]]) if bad.size else np.inf


def _judged(one: Sampled) -> Floats:
    """Of which moments the estimates are that samples are compared with: before each arrives, and nothing has jumped.

    A late one is compared with what had been estimated when it was taken.
    """
    available = one.available
    gaps = np.diff(distinct(available))
    little = _LITTLE * (float(gaps.min()) if gaps.size else 1.0)
    return np.where(available > one.taken, one.taken, np.maximum(available - little, 0.0))


def _normal(
    prepared: PreparedEstimate,
    covariance: Covariance,
    rows: Floats,
    times: Floats,
    shown: Floats,
    before: Sequence[Floats],
    predicted: Sequence[Floats],
    aside: Mapping[str, Compared],
    j: int,
) -> Normal:
    """What observer j knows of its errors, and what its innovations and held-out residuals are in its own eyes."""
    model, layout = prepared.run.plant.model, prepared.run.structure.system.held

    def variance(moments: Floats, i: int) -> Floats:
        """Of samples of output i."""
        found = np.empty(moments.size)
        for start in range(0, moments.size, _PIECE):
            some = slice(start, start + _PIECE)
            held = prepared.held(moments[some])
            w = np.zeros(layout.size) if held is None else held
            found[some] = covariance.variance(moments[some], rows[np.searchsorted(times, moments[some])], w)[:, i]
        return found

    def deviation(one: Compared) -> Floats:
        if one.name in model.outputs:
            return np.asarray(np.sqrt(variance(one.taken, model.outputs.index(one.name))))
        of_states = covariance.deviation(rows[np.searchsorted(times, one.taken)])
        return np.asarray(of_states[:, model.states.index(one.name)])

    nis = [predicted[i][j] ** 2 / variance(moments, i) for i, moments in enumerate(before)]
    known = {name: deviation(one) for name, one in aside.items()}
    return Normal(covariance.deviation(rows[np.searchsorted(times, shown)]), nis, known)


def inside(signal: Signal, origin: float, end: float) -> tuple[Floats, Floats]:
    """Times and values of a signal in a run."""
    taken = signal.taken - origin
    inside = (taken >= 0.0) & (taken <= end)
    return taken[inside], signal.values[inside]


def compared_with(
    prepared: PreparedEstimate, name: str, taken: Floats, values: Floats, xhat: Sequence[Floats]
) -> Compared:
    model = prepared.run.plant.model
    if name in model.outputs:
        i = model.outputs.index(name)
        residuals = [model.wrapped(i, values - prepared.outputs(taken, x)[:, i]) for x in xhat]
    else:
        k = model.states.index(name)
        residuals = [values - x[:, k] for x in xhat]
    return Compared(name, taken, values, np.array(residuals).reshape(len(xhat), taken.size))


def with_lag(prepared: PreparedEstimate, one: Compared, lag: float | None) -> Compared:
    """A measured quantity beside what its instrument would have shown of the estimates; itself without a lag."""
    if lag is None:
        return one
    model = prepared.run.plant.model
    periods = dict(zip(model.outputs, model.periods, strict=False))
    return replace(one, residuals=behind(one.taken, one.values, one.residuals, lag, periods.get(one.name)))


def innovations_of(
    prepared: PreparedEstimate, output: int, times: Floats, xhat: Sequence[Floats], carried: Carried
) -> Floats:
    """Measured minus estimated at the time of every sample of an output.

    The innovation where a sample was known at once. Of a late one what had been estimated when it was taken.
    """
    one, model = prepared.samples[output], prepared.run.plant.model
    innovations, observers = carried.raw.innovations, range(len(prepared.run.observers))
    own = [innovations[prepared.own_slots(output, j), j, 0] for j in observers]
    found = -model.wrapped(output, np.reshape(own, (len(observers), one.values.size)))
    if one.available is not one.taken and np.any(late := one.available > one.taken):
        taken = one.taken[late]
        places = np.searchsorted(times, taken)
        for j, x in enumerate(xhat):
            found[j, late] = model.wrapped(output, one.values[late] - prepared.outputs(taken, x[places])[:, output])
    return np.asarray(found)
