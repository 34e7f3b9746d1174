"""The strength of the sensors' noise, for observers that weigh the measurement by it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from hgorun.config.expressions import parse
from hgorun.measurement.availability import Stretch
from hgorun.measurement.blocks import Periodic, Times
from hgorun.measurement.noise import is_relative
from hgorun.symbolic.sensors import Sensor


class _Unknown(Exception):
    """Why numbers do not follow from the noise."""


class _Strength(NamedTuple):
    """Of the noise in a stretch: its variance, and the density; None where that is not known."""

    power: float
    density: float | None


def sensors_of(
    stretches: Iterable[Sequence[Stretch]], intervals: Mapping[int, float] | None = None
) -> tuple[Sensor, ...]:
    """What is known of the noise of every output, from all of its stretches.

    The variance of a sample is exact: that of gaussian and uniform noise, the mean square of sinusoids, their sum for
    noise of several kinds. Noise that is held for a time dt on a continuous output has the density variance times dt,
    the area of its autocorrelation; samples of white noise have variance times their mean interval.

    Parameters
    ----------
    stretches : iterable of sequence of Stretch
        By output.
    intervals : mapping of int to float, optional
        By the numbers of outputs the mean time between samples, where that is another one than the sampling says.
    """
    told = intervals or {}
    return tuple(_sensor(one, told.get(i)) for i, one in enumerate(stretches))


def _sensor(stretches: Sequence[Stretch], told: float | None) -> Sensor:
    intervals = {_interval(s) for s in stretches}
    period = intervals.pop() if len(intervals) == 1 else None
    interval = period if told is None else told
    delays = {float(parse(s.delay).number()) if s.delay_is_constant else None for s in stretches}
    delay, amplitude = delays.pop() if len(delays) == 1 else None, _amplitude(stretches)
    first_sample, sampled = _first(stretches), not all(s.continuous for s in stretches)
    try:
        strengths = [_strength(s, told) for s in stretches]
        if len({one.power for one in strengths}) > 1 or len({s.multiplicative for s in stretches}) > 1:
            raise _Unknown("the noise changes from one phase to the next")
    except _Unknown as unknown:
        why, continuous = str(unknown), any(s.continuous for s in stretches)
        return Sensor(
            None,
            None,
            interval,
            why=why,
            amplitude=amplitude,
            delay=delay,
            continuous=continuous,
            first=first_sample,
            sampled=sampled,
            period=period,
        )
    first = strengths[0]
    power = None if stretches[0].multiplicative else first.power
    continuous = any(s.continuous for s in stretches)
    variance = None if continuous else first.power
    density = first.density if len({one.density for one in strengths}) == 1 else None
    why = "the output is continuous: it has no samples" if variance is None else ""
    if density is None:
        why = why or "the mean time between its samples is not known, or changes"
    multiplicative = stretches[0].multiplicative
    return Sensor(
        variance,
        density,
        interval,
        multiplicative,
        why,
        amplitude,
        delay,
        power,
        continuous,
        first_sample,
        sampled,
        period,
    )


def _first(stretches: Sequence[Stretch]) -> float:
    """When the first sample is due, counted from the start of the run; 0 where there is none."""
    for stretch in stretches:
        sampling = stretch.sampling
        if isinstance(sampling, Times):
            due = [t - stretch.origin for t in sampling.times if t - stretch.origin >= stretch.start]
        else:
            due = [stretch.start + (sampling.offset if isinstance(sampling, Periodic) else 0.0)]
        if not stretch.continuous and due and due[0] <= stretch.end:
            return float(due[0])
    return 0.0


def _amplitude(stretches: Sequence[Stretch]) -> float | None:
    """Of the noise in the phase where it is largest; None where there is none, or it is not known."""
    if any(is_relative(s) or s.multiplicative for s in stretches):
        return None
    found = [item.largest() for s in stretches for item in s.noise]
    if any(amplitude is None for amplitude in found):
        return None
    return max(sum(item.largest() or 0.0 for item in s.noise) for s in stretches) or None


def _interval(stretch: Stretch) -> float | None:
    """The mean time between two samples."""
    sampling = stretch.sampling
    if isinstance(sampling, Times) and len(sampling.times) > 1:
        return (sampling.times[-1] - sampling.times[0]) / (len(sampling.times) - 1)
    return stretch.period


def _strength(stretch: Stretch, told: float | None) -> _Strength:
    if is_relative(stretch):
        raise _Unknown("the size of its noise is relative to the output (snr_db)")
    variance, density = 0.0, 0.0
    for item in stretch.noise:
        spectrum = item.spectrum()
        if spectrum is None:
            raise _Unknown(f"noise of type {item.type} has no spectrum that is known")
        if spectrum.waves and stretch.continuous:
            raise _Unknown("sinusoids on a continuous output have no density")
        variance += sum(abs(wave.phasor) ** 2 / 2 for wave in spectrum.waves)
        variance += sum(draws.variance for draws in spectrum.draws)
        if stretch.continuous:
            density += sum(draws.variance * (draws.hold or 0.0) for draws in spectrum.draws if draws.variance)
    if not variance > 0:
        raise _Unknown("the output has no noise")
    if stretch.continuous:
        return _Strength(variance, density)
    interval = _interval(stretch) if told is None else told
    return _Strength(variance, None if interval is None else variance * interval)
