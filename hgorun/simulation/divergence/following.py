"""Whether an observer still follows what is measured: a bounded estimate may be as wrong as one that grows.

Noise, delays and models that do not fit may make an estimate of any state but the measured ones worse than none. The
output, though, is what an observer is fed with: its own estimate of an output errs by no more than what there is in the
run, unless nothing brings it back. That is so with gains that are too large for the period of the samples or for the
delay: the error changes its sign and grows from sample to sample, up to where the plant's own damping holds it.

What there is in the run is the largest of all states, outputs and first errors, and of the noise as high gains amplify
it, whatever their units. A single output would not do: it may rest where another one moves or is noisy, or where a
transient has just begun.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.measurement.availability import Stretch
from hgorun.measurement.channels import Channel
from hgorun.measurement.signals import noise_at
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.records.status import Verdict
from hgorun.simulation.divergence.verdict import astray, ends, may_be_astray, size_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import Floats

Finely = Callable[[Floats], Raw]

_AMPLIFIED = 10.0  # times the noise: what gains just below the largest for a period make of it
_A_SWING, _FINER = 8, 40_000  # points of a finer grid between two samples, and all of them at most
_SAMPLES = 100_000  # whose noise is looked at, where there are more


def near(run: PreparedRun, truths: Estimated, estimates: Estimated) -> bool:
    """Whether all observers follow all outputs at the :func:`ends`, since they are not far off in any state."""
    if not _late_or_sampled(run):
        return True
    if run.structure.outputs.places is None:
        return False
    x, xhat = (of.stack().swapaxes(1, 2) for of in (truths, estimates))
    with np.errstate(over="ignore", invalid="ignore"):
        largest = np.max(np.abs(xhat[1:] - x[1:]), axis=0)
    return not bool(np.any(may_be_astray(largest, size_of(x, xhat))))


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
    y, yhat = _outputs(run, run.grid[points], rows, j, xhat)
    largest = np.max(np.abs(yhat[1:] - y[1:]), axis=0)
    return bool(may_be_astray(largest, size_of(rows[:, run.structure.truths[j]], xhat)))


def _late_or_sampled(run: PreparedRun) -> bool:
    """Whether any output arrives late or in samples: to what is at hand at all times no gain is too large."""
    return any(not (s.continuous and s.undelayed) for channel in run.channels for s in channel.stretches)


@np.errstate(over="ignore", invalid="ignore")
def no_longer_follows(run: PreparedRun, raw: Raw, j: int, xhat: Floats, finely: Finely | None = None) -> Verdict | None:
    """``diverged`` from the time on from which an observer does not follow an output.

    Parameters
    ----------
    xhat : ndarray, shape (N, n)
        The estimate of observer j on the run's grid.
    finely : callable, optional
        The same run at other times, for a grid whose points are so far apart that an error may swing between them.
    """
    times, points, rows = run.grid, ends(len(xhat), run.experiment.grid[2]), raw.rows[:, :, 0]
    if not _late_or_sampled(run) or not may_not_follow(run, points, rows[points], j, xhat[points]):
        return None
    y, yhat = _outputs(run, times, rows, j, xhat)
    largest = np.max(np.abs(y), axis=0)
    noise = [_AMPLIFIED * _noise(run, c, size) for c, size in zip(run.channels, largest.tolist(), strict=True)]
    states = rows[:, run.structure.truths[j]]
    size = max(float(size_of(states, xhat)), float(size_of(y, yhat)), *noise)
    found = astray(y, yhat, size, points[1:])
    finer = _finer_grid(run)
    off = may_be_astray(np.max(np.abs(yhat - y)[points[1:]], axis=0), np.array(size))
    if found is None and finely is not None and finer is not None and np.any(off):  # it may swing between the points
        times, rows = finer, finely(finer).rows[:, :, 0]
        y, yhat = _outputs(run, times, rows, j, run.structure.estimates[j].along(times, run.numbers.p, rows))
        found = astray(y, yhat, size, ends(len(times))[1:])
    if found is None:
        return None
    output, point = found
    name, error = run.plant.model.outputs[output], np.nanmax(np.abs(yhat - y)[point:, output])
    reason = (
        f"its estimate of {name} errs by up to {error:.2g}, this way and that, where all states, outputs, first errors "
        f"and {_AMPLIFIED:g} times the noise are at most {size:.2g}: it no longer follows what is measured"
    )
    return Verdict("diverged", float(times[point]), reason)


def _finer_grid(run: PreparedRun) -> Floats | None:
    """Times between which no error swings that comes from periods or delays; None where those of the run are so close.

    They are those of the end of the run, where it would be too many.
    """
    apart = [_apart(s, run.span) for channel in run.channels for s in channel.stretches]
    spacing, end = min(apart) / _A_SWING, float(run.grid[-1])
    if run.grid.size < 2 or run.grid[1] - run.grid[0] <= 2 * spacing * (1 + 1e-9):
        return None
    last = int(end / spacing * (1 + 1e-12))
    return np.asarray(spacing * np.arange(max(last - _FINER, 0), last + 1))


def _apart(stretch: Stretch, span: float) -> float:
    """The time between samples, or their delay, which an error that grows from one to the next swings with."""
    delay = float(np.max(stretch.delay_at(np.array([stretch.start, stretch.end]))))
    if stretch.continuous:
        return delay if delay > 0 else span
    return stretch.period or span


def _outputs(run: PreparedRun, times: Floats, rows: Floats, j: int, xhat: Floats) -> tuple[Floats, Floats]:
    """The outputs without noise of what an observer estimates, and of its estimate, without whole periods between.

    Shapes (len(times), q).
    """
    structure, model = run.structure, run.plant.model
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
