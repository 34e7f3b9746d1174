"""What measurement noise does to the estimates: predicted, measured, and the norms of the linearised observer."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.convergence.premises import theta_of
from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.linear.sinusoids import exponents
from hgorun.analysis.linear.transfer import h2 as h2_norm
from hgorun.analysis.linear.transfer import hinf as hinf_norm
from hgorun.analysis.linear.transfer import response
from hgorun.analysis.noise.prediction import has_noise, measured_noise, predicted_noise, without_noise
from hgorun.analysis.noise.responses import linear_at_end, with_other_theta
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import NoValue, outcome, require_estimate
from hgorun.analysis.subject import Context, Subject, once
from hgorun.noise.base import Wave
from hgorun.result.result import Result
from hgorun.simulation.outcome.outcome import since_start
from hgorun.simulation.simulate import prepare, simulate_prepared


@once
def _noise_free(context: Context) -> Result:
    if not has_noise(context.run):
        raise NoValue("the measurement has no noise")
    run = prepare(without_noise(context.run.experiment))
    return since_start(run, simulate_prepared(run))


@finding(
    "root mean square of the effect of the noise on the estimate. In the steady state, from the noise's amplitudes and "
    "variances; if the linearisation changes along the run, over `metrics.window`, from the noise of the run, with the "
    "mean slope between the estimates with and without noise",
    unit="state",
    group="noise, predicted",
    places=("json", "table", "compare"),
)
def noise_rms_predicted(observer: Subject) -> dict[str, float]:
    noise_free = _noise_free(observer.context)
    return observer.by_state(predicted_noise(observer.run, observer.label, noise_free, observer.result))


@finding(
    "root mean square of the difference from the run without noise, on the output grid",
    unit="state",
    group="noise, measured",
)
def noise_rms_measured(observer: Subject) -> dict[str, float]:
    noise_free = _noise_free(observer.context)
    rms = measured_noise(observer.result, noise_free, observer.label)
    if not np.all(np.isfinite(rms)):
        for result in (observer.result, noise_free):
            require_estimate(result.observers[observer.label])
    return observer.by_state(rms)


@finding(
    "standard deviation under white noise of unit density, for the observer linearised at the end of the run, with a "
    "continuous output without delay",
    unit="state/output/time^(1/2)",
)
def h2(observer: Subject) -> dict[str, float]:
    return observer.by_state(h2_norm(linear_at_end(observer)))


@finding("the largest amplification of a sinusoid, for the observer linearised as for `h2`", unit="state/output")
def hinf(observer: Subject) -> Remarked:
    largest, _ = hinf_norm(linear_at_end(observer))
    end = observer.run.origin + observer.result.time[-1]
    when = f"h2, hinf: linearised at t = {end:.4g}, output continuous and not late"
    return Remarked(observer.by_state(largest.max(axis=1)), (when,))


def _waves(observer: Subject) -> tuple[Wave, ...]:
    """The sinusoids of the first output's noise, which must be continuous and without delay."""
    linear_at_end(observer)
    channel = observer.run.channels[0]
    stretch = channel.stretches[-1]
    waves = NoiseTerms.of(channel.noise[-1]).waves
    if not stretch.continuous or not stretch.undelayed or not waves:
        raise NoValue("only for sinusoids on a continuous output without delay")
    return waves


@finding(
    "amplitude of the estimate under the sinusoids of the configuration, for the observer linearised as for `h2`",
    unit="state",
)
def noise_amplitude(observer: Subject) -> dict[str, float]:
    waves = _waves(observer)
    sizes = np.abs([wave.phasor for wave in waves])
    if observer.run.channels[0].stretches[-1].multiplicative:
        sizes = sizes * abs(float(observer.result.y[-1, 0]))
    gains = np.abs(response(linear_at_end(observer), np.array([wave.omega for wave in waves])))
    return observer.by_state(sizes @ gains[:, :, 0])


@once
def _exponents(observer: Subject) -> tuple[np.ndarray, np.ndarray]:
    fastest = float(np.abs([wave.omega for wave in _waves(observer)]).max())
    theta = outcome(lambda: theta_of(observer)).found
    other = None if theta is None else lambda factor: with_other_theta(observer, theta * factor)
    return exponents(linear_at_end(observer), other, fastest)


def _exponent(observer: Subject, slopes: np.ndarray) -> dict[str, float]:
    if not np.any(np.isfinite(slopes)):
        raise NoValue("noise does not reach the estimate, or there is no theta")
    return observer.by_state(slopes)


@finding("the exponent of `noise_amplitude` in eps = 1/omega, at the fastest sinusoid")
def noise_exponent_eps(observer: Subject) -> dict[str, float]:
    return _exponent(observer, _exponents(observer)[0])


@finding("the exponent of `noise_amplitude` in theta, at the fastest sinusoid")
def noise_exponent_theta(observer: Subject) -> dict[str, float]:
    return _exponent(observer, _exponents(observer)[1])
