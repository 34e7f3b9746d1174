"""What an observer may know of the noise of its sensors."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Sensor:
    """The noise of one output, as far as numbers follow from the configuration.

    Attributes
    ----------
    variance : float or None
        Of a sample, in y^2, or relative to h^2 where the noise is ``multiplicative``; None for continuous outputs, and
        where ``why`` says the reason.
    density : float or None
        Of white noise that is as strong in the long run: variance times the time between two draws, in y^2 time.
    interval : float or None
        The mean time between two samples; None where there are none, or nothing is known of it.
    period : float or None
        The usual time between two samples: the mean, but where samples are missing in a recording.
    multiplicative : bool
        Whether the noise is in proportion to the output.
    amplitude : float or None
        What the noise does not exceed, or rarely: amplitudes of sinusoids, two standard deviations of gaussian noise,
        the bound of uniform noise, added; None where there is no noise, or it is not known.
    why : str
        Why there is no variance or no density.
    delay : float or None
        By how much it is late; None where that changes.
    power : float or None
        Mean square of the noise, in y^2, of continuous outputs too; None where it is not known, or relative to h.
    continuous, sampled : bool
        Whether it is so in any phase.
    first : float
        When the first sample is due, counted from the start of the run; 0 where there are none.
    """

    variance: float | None
    density: float | None
    interval: float | None
    multiplicative: bool = False
    why: str = ""
    amplitude: float | None = None
    delay: float | None = 0.0
    power: float | None = None
    continuous: bool = False
    first: float = 0.0
    sampled: bool = False
    period: float | None = None
