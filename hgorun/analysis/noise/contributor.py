"""What the analysis says of noise: norms of the linearised observer, predicted and measured size of the noise."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.findings import Context, Findings
from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.sinusoids import exponents
from hgorun.analysis.linear.transfer import h2, hinf, require_hurwitz, response
from hgorun.analysis.noise.prediction import measured_noise, noise_free, noise_prediction
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.errors import HgorunError
from hgorun.simulation.simulate import simulate
from hgorun.analysis.reasons import NoValue

_PREDICTED = ("noise_rms_predicted", "noise_rms_measured")
_NORMS = ("h2", "hinf")
_STEADY = ("noise_amplitude", "noise_exponent_eps", "noise_exponent_theta")


def noise(context: Context) -> dict[str, Findings]:
    """Of every observer."""
    found = {label: Findings() for label in context.result.observers}
    _sizes(context, found)
    for label, findings in found.items():
        _gains(context, label, findings)
    return found


def _sizes(context: Context, found: dict[str, Findings]) -> None:
    """The noise in the estimates over the metrics' window, predicted and measured by a run without noise."""
    states = context.result.states
    if not any(stretch.noise for channel in context.run.channels for stretch in channel.stretches):
        for findings in found.values():
            findings.withhold("the measurement has no noise", *_PREDICTED)
        return
    twin = simulate(noise_free(context.run.experiment))
    measured = measured_noise(context.result, twin)
    for label, prediction in noise_prediction(context.run, twin, context.result).items():
        findings = found[label]
        if np.all(np.isfinite(measured[label])):
            findings.give(noise_rms_measured=_by_state(states, measured[label]))
        else:
            findings.withhold("the observer diverged", "noise_rms_measured")
        if prediction.rms is None:
            findings.withhold(str(prediction.reason), "noise_rms_predicted")
        else:
            findings.give(noise_rms_predicted=_by_state(states, prediction.rms))


def _gains(context: Context, label: str, findings: Findings) -> None:
    """Norms and steady amplitudes at the end of the run, as if the output were continuous and not late."""
    run, result, states = context.run, context.result, context.result.states
    try:
        linear = at_the_end(context, label)
        largest, _ = hinf(linear)
        findings.give(h2=_by_state(states, h2(linear)), hinf=_by_state(states, largest.max(axis=1)))
        findings.remarks.append(f"h2, hinf: linearised at t = {result.time[-1]:.4g}, output continuous and not late")
    except NoValue as reason:
        findings.withhold(str(reason), *_NORMS, *_STEADY)
        return
    stretch = run.channels[0].stretches[-1]
    waves = NoiseTerms.of(stretch, run.channels[0].random[-1]).waves
    if not stretch.continuous or not stretch.undelayed or not waves:
        why = "they are of sinusoids on a continuous output that is not late"
        findings.withhold(why, *_STEADY)
        return
    omegas = np.array([w.omega for w in waves])
    sizes = np.abs([w.phasor for w in waves])
    if stretch.multiplicative:
        sizes = sizes * abs(float(result.y[-1, 0]))
    findings.give(noise_amplitude=_by_state(states, sizes @ np.abs(response(linear, omegas))[:, :, 0]))
    try:
        in_eps, in_theta = exponents(run, label, float(np.abs(omegas).max()), x=result.x[-1])
        for key, slopes in (("noise_exponent_eps", in_eps), ("noise_exponent_theta", in_theta)):
            if np.any(np.isfinite(slopes)):
                findings.give(**{key: _by_state(states, slopes)})
            else:
                findings.withhold("noise does not reach the estimate, or there is no theta", key)
    except HgorunError as reason:
        findings.withhold(str(reason), "noise_exponent_eps", "noise_exponent_theta")


def at_the_end(context: Context, label: str) -> Linear:
    """The linearised observer at the last point of the run, with no innovation.

    Raises
    ------
    NoValue
        When it is not Hurwitz there, or there is no such system.
    """
    observer = Linearisation(context.run, label)
    if observer.block.observer.discrete:
        raise NoValue("the observer jumps at the samples: there is no flow between them")
    found = context.result.observers[label]
    if found.diverged_at is not None:
        raise NoValue("the observer diverged")
    last = context.result.time.size - 1
    linear = observer.at(float(context.result.time[-1]), observer.along(found, last))
    require_hurwitz(linear)
    return linear


def _by_state(states: tuple[str, ...], values: np.ndarray) -> dict[str, float]:
    return dict(zip(states, map(float, values), strict=True))
