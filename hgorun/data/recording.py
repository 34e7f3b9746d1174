"""What was measured, as arrays: one clock for every signal, and the line of every value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from hgorun.config.named import name_keys
from hgorun.data.times.time_steps import even_step
from hgorun.files import real_path

Hold = Literal["zero", "linear"]
AUTO: Final = "auto"
FirstSamples: TypeAlias = int | Literal["auto"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Signal:
    """The samples of one quantity, sorted by the time they were taken, then by when they were available.

    Attributes
    ----------
    name : str
    unit : str
        Of the values; empty where it is not known.
    taken, available : ndarray, shape (n,)
        The time it was measured, and the time it was known; the same array where samples are not late.
    values : ndarray, shape (n,)
        Finite.
    lines : ndarray of integers, shape (n,)
        Where in the file each sample stands, from 1 on: its line, or its row where the file has no lines.
    source : Path
        The file; of a log in several parts the first one, and lines are those of each part.
    column : str
        What it is called there.
    std : float, optional
        Standard deviation of the noise, where it was stated.
    plausible : tuple of float, optional
        Between what the values may lie; those outside are not among them unless that was asked for.
    gate : float, optional
        Standard deviations of the innovation beyond which a sample is not used.
    lag : float, optional
        Time constant of the instrument, which follows the quantity with a lag of the first order.
    sources : tuple of Path
        All parts of a log.
    part : ndarray of integers
        In which of them each sample stands; empty where there is one.
    """

    name: str
    unit: str
    taken: np.ndarray
    available: np.ndarray
    values: np.ndarray
    lines: np.ndarray
    source: Path
    column: str
    std: float | None = None
    plausible: tuple[float, float] | None = None
    gate: float | None = None
    lag: float | None = None
    sources: tuple[Path, ...] = ()
    part: np.ndarray = field(default_factory=lambda: np.empty(0, np.int16))

    def __repr__(self) -> str:
        return f"<Signal {self.name!r}: {self.values.size} samples from {self.source.name}>"

    def place(self, k: int) -> tuple[str, int]:
        """File and line of a sample."""
        return _place(self, k)

    def stands_in(self, file: Path) -> np.ndarray:
        """Which of the samples stand in a file, shape (n,)."""
        where = [k for k, source in enumerate(self.sources) if real_path(source) == real_path(file)]
        part = self.part if self.part.size else np.zeros(self.values.size, np.int16)
        return np.isin(part, where)

    @property
    def late(self) -> bool:
        """Whether some samples were known only after they had been taken."""
        return self.available is not self.taken and bool(np.any(self.available > self.taken))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class InputSignal:
    """An input of the plant as it was recorded.

    Attributes
    ----------
    name, unit : str
    times, values : ndarray, shape (n,)
        Times increase.
    hold : {"zero", "linear"}
        What it is between them: the last value, or a straight line.
    lines : ndarray of integers, shape (n,)
    source : Path
    sources : tuple of Path
    part : ndarray of integers
        As of a :class:`Signal`.
    """

    name: str
    unit: str
    times: np.ndarray
    values: np.ndarray
    hold: Hold
    lines: np.ndarray
    source: Path
    sources: tuple[Path, ...] = ()
    part: np.ndarray = field(default_factory=lambda: np.empty(0, np.int16))

    def __repr__(self) -> str:
        return f"<InputSignal {self.name!r}: {self.values.size} values from {self.source.name}>"

    def place(self, k: int) -> tuple[str, int]:
        """File and line of a value."""
        return _place(self, k)


def _place(signal: Signal | InputSignal, k: int) -> tuple[str, int]:
    """File and line of a sample of a log, which may have several parts."""
    source = signal.sources[int(signal.part[k])] if signal.part.size else signal.source
    return str(source), int(signal.lines[k])


@dataclass(frozen=True, kw_only=True)
class Note:
    """Something found in the data and handled as told, or reported only.

    Attributes
    ----------
    kind : str
        ``missing``, ``unknown``, ``implausible``, ``quality``, ``repeated``, ``backwards``, ``gaps``, ``filled``,
        ``stuck``, ``slips``, ``units``, ``clock``, ``format``, ``used``, ``sentinel``, ``tags``,
        ``wraps``.
    signal : str
        The signal it is about, or several, with commas; empty where it is about a file.
    file : str
    line : int
        The first line concerned; 0 where it is about no line.
    count : int
        How many samples are concerned.
    message : str
        A sentence without place.
    consequence : str
        What follows from it for signals of one group, behind a semicolon.
    """

    kind: str
    signal: str
    file: str
    line: int = 0
    count: int = 0
    message: str
    consequence: str = ""

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        told = "; ".join(part for part in (self.message, self.consequence) if part)
        return ": ".join(part for part in (place, self.signal, told) if part)


@dataclass(frozen=True, kw_only=True)
class Origin:
    """What the times of a recording are counted from.

    Numbers in a time column stay on their own clock, only in the unit of the run. Absolute stamps are counted from the
    first of them, or from the origin that was stated.

    Attributes
    ----------
    unit : str
        Of all times.
    epoch : numpy.datetime64, optional
        The absolute time (to the nanosecond) at time 0, where the files have absolute stamps: in UTC if ``zone`` says
        so, else on the clock of whoever wrote them.
    zone : str
        ``UTC``, or empty.
    """

    unit: str
    epoch: np.datetime64 | None = None
    zone: str = ""

    @property
    def text(self) -> str:
        """The date and time of day at time 0, as ISO 8601 writes it; empty where no file has any."""
        if self.epoch is None:
            return ""
        unit = next(one for one in ("s", "ms", "us", "ns") if self.epoch == self.epoch.astype(f"datetime64[{one}]"))
        return str(self.epoch.astype(f"datetime64[{unit}]")) + ("Z" if self.zone else "")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recording:
    """All that was measured, in the units of the model.

    Attributes
    ----------
    outputs : mapping of str to Signal
        By the plant's outputs.
    inputs : mapping of str to InputSignal
    reference : mapping of str to Signal
        Compared with, never used; by the plant's states or outputs.
    notes : tuple of Note
        What was found in the data, each with its first line.
    origin : Origin
    first_samples : int or "auto"
        Of each output: how many of them observers start from that are given no start; "auto": as many as agree.
    """

    outputs: Mapping[str, Signal]
    inputs: Mapping[str, InputSignal] = field(default_factory=dict)
    reference: Mapping[str, Signal] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    origin: Origin
    first_samples: FirstSamples = 1

    def __post_init__(self) -> None:
        name_keys(self, outputs="output", inputs="input", reference="state or output of the reference")

    def __repr__(self) -> str:
        return f"<Recording: {', '.join(map(repr, [*self.outputs.values(), *self.inputs.values()]))}>"

    @property
    def start_is_fitted(self) -> bool:
        """Whether observers start where the model passes nearest to several samples."""
        return self.first_samples == AUTO or self.first_samples > 1

    @property
    def span(self) -> tuple[float, float]:
        """From the first sample of an output to the last event of one: taken, or available where that is later."""
        ends = list(self._ends())
        return min(start for start, _ in ends), max(end for _, end in ends)

    def _ends(self) -> Iterator[tuple[float, float]]:
        for signal in self.outputs.values():
            last = signal.taken[-1]  # in their order
            known = last if signal.available is signal.taken else max(last, signal.available.max())
            yield float(signal.taken[0]), float(known)

    @property
    def median_gap(self) -> float:
        """The median of the steps between samples, of the output that has the shortest."""
        medians = [even_step(signal.taken) for signal in self.outputs.values()]
        return min((median for median in medians if not np.isnan(median)), default=float("nan"))
