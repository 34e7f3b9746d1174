"""What a measurement does, as far as all outputs have it in common, and how limits of it are told."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timing:
    """What the measurement does: samples with a period, or continuous outputs (None), and how old they are."""

    period: float | None
    delay: float
    name: str = "period"
    late: str = "delay"

    @property
    def longest(self) -> float:
        """How old a sample is at most before the next one has come."""
        return (self.period or 0.0) + self.delay

    def scaled(self, part: float) -> Timing:
        """The same with a part of all times, so that as many samples are on their way."""
        return Timing(None if self.period is None else part * self.period, part * self.delay, self.name, self.late)

    def told(self, unit: str) -> str:
        """The times in use."""
        late = f"the {self.late} {_time(self.delay, unit)}"
        if self.period is None:
            return late
        return f"the {self.name} {_time(self.period, unit)}" + (f" with {late}" if self.delay else "")

    def limits(self, gain: str | None, part: float | None, unit: str) -> str:
        """What would do: a gain, and a part of the times in use; of two of them where there is no gain to take."""
        found = [] if gain is None else [gain]
        if part is not None and (gain is None or not (self.period and self.delay)):
            times = ((self.name, self.period), (self.late, self.delay))
            found.append(
                " and ".join(f"a {name} of at most {_limit(part * time, unit)}" for name, time in times if time)
            )
        return ", or ".join(found)


def below(value: float) -> str:
    """A limit in two digits that keeps it."""
    size = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.floor(value / size * (1 + 1e-9)) * size:.6g}"


def listed(times: Iterable[str], unit: str) -> str:
    """Several times in one unit."""
    return f"{' and '.join(times)} {unit}".rstrip()


def _time(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".rstrip()


def _limit(value: float, unit: str) -> str:
    return f"{below(value)} {unit}".rstrip()
