"""What a kind of noise is: a function of time, or random draws.

A kind's file holds its formula and nothing else. The class is also the model of its YAML block: each field
is a key, with its admissible range. All that the rest of hgorun asks of noise is asked here, so a new kind is
one class: derive it from :class:`TimeFunction` or :class:`RandomNoise`, whichever it is.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from inspect import isabstract
from typing import ClassVar, TypeGuard

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.plugin import Plugin
from hgorun.config.reads import frozen
from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.noise.streams import Stream, Streams
from hgorun.registry import Registry
from hgorun.symbolic.evaluate import along

_PIECES = 4096  # of a span of time, in which a function of time is enclosed


@dataclass(frozen=True)
class Wave:
    """The imaginary part of ``phasor`` exp(j omega t): a sinusoid with its phase."""

    phasor: complex
    omega: float


@dataclass(frozen=True)
class Draws:
    """Independent draws, one a sample, or one every ``hold``; ``hold`` infinite: one for ever, a constant."""

    mean: float
    variance: float
    hold: float | None


@dataclass(frozen=True)
class Spectrum:
    """Noise as linear theory takes it: a sum of sinusoids and of independent draws."""

    waves: tuple[Wave, ...] = ()
    draws: tuple[Draws, ...] = ()


class Noise(Plugin):
    """One item of ``measurement.noise``; derive from :class:`TimeFunction` or :class:`RandomNoise`."""

    kind: ClassVar[str] = "noise"
    reference: ClassVar[str] = ""

    def check(self, *, continuous: bool) -> None:
        """Refuse an output that the noise does not fit to: continuous, or sampled.

        Raises
        ------
        Problem
            Its path starts at this block.
        """

    @abstractmethod
    def silent(self) -> dict[str, object]:
        """The block of noise of size zero that changes at the same times."""

    def spectrum(self) -> Spectrum | None:
        """What linear theory needs to predict the noise in the estimates; None where it is not known."""
        return None

    def largest(self) -> float | None:
        """What it does not exceed, or rarely: sinusoids added, two standard deviations of draws; None: not known."""
        spectrum = self.spectrum()
        if spectrum is None:
            return None
        waves = sum(abs(wave.phasor) for wave in spectrum.waves)
        return float(waves + sum(abs(draws.mean) + 2 * np.sqrt(draws.variance) for draws in spectrum.draws))


class TimeFunction(Noise):
    """Noise that is a function v(t) of time."""

    def numbers(self) -> Mapping[str, Sequence[float]]:
        """Numbers that may differ between runs of the same compiled code: amplitudes, frequencies, ...."""
        return {}

    @abstractmethod
    def symbol(self, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
        """v(t).

        Parameters
        ----------
        t : casadi.SX
        numbers : mapping of str to casadi.SX
            A column for each of :meth:`numbers`.
        """

    def structure(self) -> Hashable:
        """What :meth:`symbol` depends on besides the numbers: noise that agrees in it shares its compiled code."""
        return frozen(self.model_dump())

    def at(self, times: np.ndarray, k: np.ndarray) -> np.ndarray:
        """v at samples, at times t_k and numbered k, shape (len(times),)."""
        t = ca.SX.sym("t")
        return along(ca.Function("v", [t], [self._of(t)]), times)

    def fastest(self, start: float, end: float) -> float:
        """The highest frequency between start and end that an automatic step has to follow, in rad per time unit.

        0 where there is none.
        """
        return 0.0

    def bound(self, start: float, end: float) -> float:
        """A number that |v(t)| does not exceed between start and end: by interval arithmetic, unless overridden."""
        from hgorun.symbolic.enclosures import Enclosure  # theory asks for it, not a run

        t = ca.SX.sym("t")
        edges = np.linspace(start, end, _PIECES + 1)[:, None]
        low, high = Enclosure(ca.Function("v", [t], [ca.densify(self._of(t))]))(edges[:-1], edges[1:])
        return float(np.max(np.maximum(np.abs(low), np.abs(high))))

    def silent(self) -> dict[str, object]:
        return {"type": "expression", "value": "0"}

    def _of(self, t: ca.SX) -> ca.SX:
        """v(t) with numbers in it."""
        return ca.SX(self.symbol(t, {name: ca.SX(ca.DM(values)) for name, values in self.numbers().items()}))


class RandomNoise(Noise):
    """Noise that is drawn: a draw a sample, or one every ``hold``.

    The generator of the draws is a child of the run's seed, named by the output, its phase and the place among
    the random noise there. So draws depend on nothing else, and a longer run begins with those of a shorter one.
    """

    hold: Positive | None = Field(default=None, description="a new draw every hold from start, constant between")

    bounded: ClassVar[bool] = False  # whether draws cannot be as large as they like
    scaled_by: ClassVar[str | None] = None  # a key that multiplies draws, so that members of an ensemble share them

    @abstractmethod
    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """The first draws of a run, shape (count,): the same ones, whatever the count."""

    def draw_many(self, streams: Streams, count: int) -> np.ndarray:
        """What :meth:`draw` gives for each of several generators, shape (len(streams), count)."""
        drawn = [self.draw(streams.generator(i), count) for i in range(len(streams))]
        return np.array(drawn, dtype=float).reshape(len(streams), count)

    def relative(self) -> bool:
        """Whether the size is given relative to that of the noise-free output."""
        return False

    def absolute(self, mean_square: float) -> RandomNoise:
        """The noise with its size as a number.

        Parameters
        ----------
        mean_square : float
            Mean over the run of the noise-free output squared; asked for where the noise is :meth:`relative`.
        """
        return self

    def check(self, *, continuous: bool) -> None:
        if continuous and self.hold is None:
            raise Problem((), f"{self.type} noise on a continuous measurement needs hold: the time between two draws")

    def silent(self) -> dict[str, object]:
        return {"type": "gaussian", "std": 0} | ({} if self.hold is None else {"hold": self.hold})


class DrawnInParts(RandomNoise):
    """Noise whose draws can be made one part after the other, so that a run of any length needs no memory for them."""

    @abstractmethod
    def draw_next(self, stream: Stream, count: int) -> np.ndarray:
        """The next draws, shape (count,): call after call, what :meth:`draw` gives at once."""


def is_noise(thing: object) -> TypeGuard[type[Noise]]:
    """Whether it is the class of a kind of noise, with nothing left abstract."""
    return isinstance(thing, type) and issubclass(thing, (TimeFunction, RandomNoise)) and not isabstract(thing)


NOISE: Registry[type[Noise]] = Registry(
    "noise",
    package="hgorun.noise",
    group="hgorun.noise",
    accepts=is_noise,
    expected="a class derived from TimeFunction or RandomNoise of hgorun.noise.base with nothing left abstract",
)
noise = NOISE.register
