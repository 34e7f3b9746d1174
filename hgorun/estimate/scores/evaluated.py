"""What of a run is compared with measurements: estimates at the times of samples, and between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from hgorun.data.recording import Signal
from hgorun.estimate.carrying import Carried, carry_out, estimates
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.scores.compared import (
    Compared,
    compared_with,
    felt_at,
    inside,
    instruments_of,
    see,
    with_lag,
)
from hgorun.estimate.scores.innovations import Innovations, InnovationsInMemory
from hgorun.estimate.scores.output_points import OutputPoints, clocks_of
from hgorun.pieces import distinct
from hgorun.symbolic.evaluate import Floats

_PIECE = 1 << 15  # samples at a time: there may be many


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
    points = OutputPoints.of(experiment, clocks_of(prepared.samples, prepared.inputs))
    chosen = {key: inside(signal, origin, end, points) for key, signal in asked.items()}
    shown = points[:]
    late = [one.taken for one in prepared.samples if one.taken is not one.available]
    covariances = prepared.covariances()
    instruments = instruments_of(prepared, asked, chosen)
    felt = felt_at(prepared, list(instruments.values()))
    times = distinct(np.concatenate([shown, *(taken for taken, _ in chosen.values()), *late, *felt]))
    carried = carry_out(prepared, times, with_error=with_error)
    everywhere = estimates(prepared, times, carried.raw) if carried.xhat is None else carried.xhat
    # where nothing is compared in between, no copies are made
    on_grid = slice(None) if times.size == shown.size else np.searchsorted(times, shown)
    compared = {
        key: compared_with(prepared, key[1], taken, values, [x[np.searchsorted(times, taken)] for x in everywhere])
        for key, (taken, values) in chosen.items()
    }
    see(prepared, instruments, times, everywhere)
    compared = {key: with_lag(one, instruments.get(key)) for key, one in compared.items()}
    outputs = range(len(prepared.samples))
    predicted = [innovations_of(prepared, i, times, everywhere, carried, covariances) for i in outputs]
    aside = {name: one for (which, name), one in compared.items() if which == 0}
    normal = [
        None if one is None else _normal(prepared, one, carried, times, shown, predicted, aside, j)
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


def _normal(
    prepared: PreparedEstimate,
    covariance: Covariance,
    carried: Carried,
    times: Floats,
    shown: Floats,
    predicted: Sequence[Floats],
    aside: Mapping[str, Compared],
    j: int,
) -> Normal:
    """What observer j knows of its errors, and what its innovations and held-out residuals are in its own eyes."""
    model = prepared.run.plant.model
    rows, kept = carried.raw.rows[:, :, 0], carried.raw.innovations[:, len(prepared.run.observers) + j, 0]

    def variance(moments: Floats, i: int) -> Floats:
        """Of samples of output i."""
        found = np.empty(moments.size)
        for start in range(0, moments.size, _PIECE):
            some = slice(start, start + _PIECE)
            w, of = _held(prepared, moments[some]), rows[np.searchsorted(times, moments[some])]
            found[some] = covariance.variance(moments[some], of, w)[:, i]
        return found

    def deviation(one: Compared) -> Floats:
        if one.name in model.outputs:
            return np.asarray(np.sqrt(variance(one.taken, model.outputs.index(one.name))))
        of_states = covariance.deviation(rows[np.searchsorted(times, one.taken)])
        return np.asarray(of_states[:, model.states.index(one.name)])

    def of_innovations(i: int) -> Floats:
        found = kept[prepared.own_slots(i, j)] + covariance.noise[i]
        taken, late = prepared.samples[i].taken, prepared.samples[i].available > prepared.samples[i].taken
        found[late] = variance(taken[late], i)  # which are compared with what had been estimated then
        return np.asarray(found)

    nis = [predicted[i][j] ** 2 / of_innovations(i) for i in range(len(predicted))]
    known = {name: deviation(one) for name, one in aside.items()}
    return Normal(covariance.deviation(rows[np.searchsorted(times, shown)]), nis, known)


def _held(prepared: PreparedEstimate, moments: Floats) -> Floats:
    """What is held at some times, of which inputs matter."""
    held = prepared.held(moments)
    return np.zeros(prepared.run.structure.system.held.size) if held is None else held


def innovations_of(
    prepared: PreparedEstimate,
    output: int,
    times: Floats,
    xhat: Sequence[Floats],
    carried: Carried,
    covariances: Sequence[Covariance | None] = (),
) -> Floats:
    """Measured minus estimated at the time of every sample of an output.

    The innovation where a sample was known at once. Of a late one what had been estimated when it was taken;
    observers with covariances may expect another mean than that.
    """
    one, model = prepared.samples[output], prepared.run.plant.model
    innovations, observers = carried.raw.innovations, range(len(prepared.run.observers))
    own = [innovations[prepared.own_slots(output, j), j, 0] for j in observers]
    rows = own[0][None] if len(own) == 1 else np.reshape(own, (len(own), one.values.size))  # of one no copy is made
    found = -model.wrapped(output, rows)
    if one.available is not one.taken and np.any(late := one.available > one.taken):
        taken = one.taken[late]
        places = np.searchsorted(times, taken)
        for (j, x), covariance in zip_longest(enumerate(xhat), covariances):
            expected = prepared.outputs(taken, x[places])[:, output]
            if covariance is not None:
                rows = carried.raw.rows[places, :, 0]
                expected = expected + covariance.offset(taken, rows, _held(prepared, taken))[:, output]
            found[j, late] = model.wrapped(output, one.values[late] - expected)
    return np.asarray(found)
