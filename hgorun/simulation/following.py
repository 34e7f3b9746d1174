"""Whether an observer still follows what is measured: a bounded estimate may be as wrong as one that grows.

Noise, delays and models that do not fit may make an estimate of any state but the measured ones worse than none. The
output, though, is what an observer is fed with: its own estimate of an output errs by no more than the size of the
output, its noise and the first error, unless nothing brings it back. That is so with gains that are too large for the
period of the samples or for the delay: the error grows from sample to sample, up to where the plant's own damping holds
it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.measurement.channels import Channel
from hgorun.measurement.signals import noise_at
from hgorun.result.estimated import Estimated
from hgorun.result.status import Verdict
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.verdict import astray, late_points, may_be_astray
from hgorun.symbolic.evaluate import Floats

_LOOKED_AT = 16  # of the last points
_SAMPLES = 100_000  # whose noise is looked at, where there are more


def ends(count: int) -> np.ndarray:
    """The first of so many points, and some of the last ones."""
    late = late_points(count)
    every = max((late.stop - late.start) // _LOOKED_AT, 1)
    return np.array([0, *reversed(range(count - 1, late.start - 1, -every))])


def near(run: PreparedRun, truths: Estimated, estimates: Estimated) -> bool:
    """Whether all observers follow all outputs at the :func:`ends`, since they are not far off in any state."""
    if run.structure.outputs.places is None:
        return False
    x, xhat = (of.stack().reshape(len(of.values), -1, 1) for of in (truths, estimates))
    return not bool(np.any(may_be_astray(x, xhat)))


@np.errstate(over="ignore", invalid="ignore")
def may_not_follow(run: PreparedRun, points: np.ndarray, rows: Floats, j: int, xhat: Floats) -> bool:
    """Whether the outputs that an observer estimates are so far off that their noise has to be known.

    Parameters
    ----------
    points : ndarray of int
        Those of :func:`ends`.
    rows, xhat : ndarray, shapes (len(points), states) and (len(points), n)
        All states there, and the estimate of observer j.
    """
    return bool(may_be_astray(*_outputs(run, points, rows, j, xhat)))


@np.errstate(over="ignore", invalid="ignore")
def no_longer_follows(run: PreparedRun, raw: Raw, j: int, xhat: Floats) -> Verdict | None:
    """``diverged`` from the time on from which an observer does not follow an output.

    Parameters
    ----------
    xhat : ndarray, shape (N, n)
        The estimate of observer j on the run's grid.
    """
    points, rows = ends(len(xhat)), raw.rows[:, :, 0]
    if not may_not_follow(run, points, rows[points], j, xhat[points]):
        return None
    y, yhat = _outputs(run, np.arange(len(xhat)), rows, j, xhat)
    largest = np.max(np.abs(y), axis=0)
    noise = np.array([_noise(run, c, size) for c, size in zip(run.channels, largest, strict=True)])
    found = astray(y, yhat, noise)
    if found is None:
        return None
    output, point = found
    gap, name = np.abs(yhat - y)[:, output], run.plant.model.outputs[output]
    largest_gap, least = np.nanmax(gap[point:]), max(largest[output] + noise[output], gap[0])
    reason = (
        f"its estimate of {name} errs by up to {largest_gap:.2g}, where {name}, its noise and the first error are at "
        f"most {least:.2g}: it no longer follows what is measured"
    )
    return Verdict("diverged", float(run.grid[point]), reason)


def _outputs(run: PreparedRun, points: np.ndarray, rows: Floats, j: int, xhat: Floats) -> tuple[Floats, Floats]:
    """The outputs without noise of what an observer estimates, and of its estimate, without whole periods between.

    Shapes (len(points), q).
    """
    structure, model, times = run.structure, run.plant.model, run.grid[points]
    if structure.outputs.places is not None:
        places = structure.outputs.places
        y, yhat = rows[:, [structure.truths[j][k] for k in places]], xhat[:, places]
    else:
        own = rows.copy()
        own[:, : model.n] = rows[:, structure.truths[j]]
        y = structure.outputs.along(times, run.numbers.p, own)
        own[:, : model.n] = xhat
        yhat = structure.outputs.along(times, run.numbers.p, own)
    if not model.periods:
        return y, yhat
    return y, np.column_stack([y[:, i] + model.wrapped(i, yhat[:, i] - y[:, i]) for i in range(y.shape[1])])


def _noise(run: PreparedRun, channel: Channel, largest: float) -> float:
    """How large the noise of an output is, at most: of its samples, and along the grid where it is continuous."""
    found = [0.0]
    for stretch, noise in zip(channel.stretches, channel.noise, strict=True):
        if stretch.continuous:
            v = np.abs(noise_at(stretch, run.grid) + noise.held(run.grid))
            found.append(float(np.max(v)) * (largest if stretch.multiplicative else 1.0))
    count = channel.samples.size
    if count:
        some = channel if count <= _SAMPLES else replace(channel, samples=channel.samples.part(0, _SAMPLES))
        gain, bias = some.gain_and_bias
        found.append(float(np.max(np.abs(bias))) + float(np.max(np.abs(gain - 1.0))) * largest)
    return max(found)
