"""Every output's availability, phase by phase, with nothing omitted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hgorun.config.expressions import ExpressionError, nearest, parse
from hgorun.config.models import Time
from hgorun.errors import KeyPath, Problem
from hgorun.measurement.blocks import Availability, Measurement, Periodic, Sampling, Steps
from hgorun.noise.base import Noise, RandomNoise, TimeFunction
from hgorun.symbolic.evaluate import along, compiled


@dataclass(frozen=True, eq=False, repr=False)
class Stretch:
    """What one output is between ``start`` and ``end``, counted from the start of the run.

    Attributes
    ----------
    sampling, delay, noise, mode
        As configured; ``delay`` is text.
    paths : dict
        Where in the file each of them was written.
    origin : float
        The start of the run on the clock of the expressions.
    """

    start: float
    end: float
    sampling: Sampling
    delay: str
    noise: tuple[Noise, ...]
    mode: str
    paths: dict[str, KeyPath]
    origin: float = 0.0

    @property
    def spacing(self) -> float:
        """How far apart neighbouring numbers are where the clock of the configuration stands."""
        return float(np.spacing(max(abs(self.origin + self.start), abs(self.origin + self.end))))

    @property
    def continuous(self) -> bool:
        return self.sampling == "continuous"

    @property
    def period(self) -> float | None:
        """The period of its samples; None where it is continuous, or sampled at other times."""
        return self.sampling.period if isinstance(self.sampling, Periodic) else None

    @property
    def regular(self) -> Periodic | None:
        """Its sampling, where that is periodic and none of the samples moves or is lost."""
        sampling = self.sampling
        return sampling if isinstance(sampling, Periodic) and not self.sampled_by_chance else None

    @property
    def sampled_by_chance(self) -> bool:
        """Whether random numbers decide when its samples are taken, or which of them are lost."""
        return isinstance(self.sampling, Periodic) and bool(self.sampling.jitter or self.sampling.dropout)

    @property
    def by_chance(self) -> bool:
        """Whether random numbers decide anything about it."""
        return self.sampled_by_chance or any(isinstance(item, RandomNoise) for item in self.noise)

    @property
    def steps(self) -> str | None:
        """The expression of k that gives the times between its samples, where there is one."""
        return self.sampling.steps if isinstance(self.sampling, Steps) else None

    @property
    def multiplicative(self) -> bool:
        return self.mode == "multiplicative"

    @property
    def undelayed(self) -> bool:
        """Whether the delay is the number zero."""
        expression = parse(self.delay)
        return not expression.names and expression.number() == 0.0

    @property
    def delay_is_constant(self) -> bool:
        """Whether the delay is a number."""
        return not parse(self.delay).names

    def fastest(self) -> float:
        """The highest frequency of its noise that an automatic step has to follow, in rad per time unit; 0 for none."""
        functions = [item for item in self.noise if isinstance(item, TimeFunction)]
        span = self.origin + self.start, self.origin + self.end
        return max((item.fastest(*span) for item in functions), default=0.0)

    def delay_at(self, times: np.ndarray) -> np.ndarray:
        """d(t) at several times."""
        expression = parse(self.delay, names=("t",))
        if not expression.names:
            return np.full(times.shape, expression.number())
        return along(compiled(self.delay, "t"), self.origin + times)

    def valid_delay_at(self, times: np.ndarray) -> np.ndarray:
        """d(t) at several times.

        Raises
        ------
        Problem
            Where it is negative or not a number.
        """
        delays = self.delay_at(times)
        if not np.all(np.isfinite(delays)) or np.any(delays < 0):
            worst = times[np.argmin(np.where(np.isfinite(delays), delays, -np.inf))]
            raise Problem(
                self.paths["delay"],
                f"the delay must be a number >= 0, found {delays.min():g} at t = {self.origin + worst:g}",
            )
        return delays


def resolve(measurement: Measurement, outputs: Sequence[str], time: Time) -> list[list[Stretch]]:
    """One list of stretches an output, from start to end without a gap, counted from the start.

    Raises
    ------
    Problem
        For unknown outputs, phases that do not cover the run, expressions that cannot be read.
    """
    _require_outputs(measurement.outputs, outputs, ("measurement", "outputs"))
    bounds = [time.start]
    for number, phase in enumerate(measurement.phases):
        path = ("measurement", "phases", number)
        _require_outputs(phase.outputs, outputs, (*path, "outputs"))
        if not phase.until > bounds[-1]:
            raise Problem(
                (*path, "until"),
                f"phases must end one after the other: {phase.until:g} is not after {bounds[-1]:g}",
            )
        bounds.append(phase.until)
    if measurement.phases:
        if bounds[-1] < time.end:
            raise Problem(
                ("measurement", "phases", len(measurement.phases) - 1, "until"),
                f"the last phase ends at {bounds[-1]:g}, before the end of the run at {time.end:g}",
            )
    else:
        bounds.append(time.end)
    found = []
    for output in outputs:
        base = _layered({}, {}, measurement, ("measurement",))
        if output in measurement.outputs:
            base = _layered(*base, measurement.outputs[output], ("measurement", "outputs", output))
        stretches = []
        for number, (start, end) in enumerate(pairwise(bounds)):
            values = base
            if measurement.phases:
                phase, path = measurement.phases[number], ("measurement", "phases", number)
                values = _layered(*values, phase, path)
                if output in phase.outputs:
                    values = _layered(*values, phase.outputs[output], (*path, "outputs", output))
            if start < time.end:
                span = start - time.start, min(end, time.end) - time.start
                stretches.append(_stretch(time.start, span, *values))
        found.append(stretches)
    return found


def _require_outputs(given: Iterable[str], outputs: Sequence[str], path: KeyPath) -> None:
    for name in given:
        if name not in outputs:
            raise Problem(
                (*path, name),
                f"unknown output {name!r}; the plant's outputs are {', '.join(outputs)}." + nearest(name, outputs),
            )


def _layered(
    values: dict[str, Any], paths: dict[str, KeyPath], block: Availability, path: KeyPath
) -> tuple[dict[str, Any], dict[str, KeyPath]]:
    """The values with those of a block on top."""
    new = {key: getattr(block, key) for key in ("sampling", "delay", "noise", "mode")}
    new = {key: value for key, value in new.items() if value is not None}
    return values | new, paths | {key: (*path, key) for key in new}


def _stretch(origin: float, span: tuple[float, float], values: dict[str, Any], paths: dict[str, KeyPath]) -> Stretch:
    stretch = Stretch(
        *span,
        values.get("sampling", "continuous"),
        values.get("delay", "0"),
        values.get("noise", ()),
        values.get("mode", "additive"),
        {key: paths.get(key, ("measurement",)) for key in ("sampling", "delay", "noise", "mode")},
        origin,
    )
    _check(stretch.paths["delay"], stretch.delay, ("t",))
    if stretch.steps is not None:
        _check((*stretch.paths["sampling"], "steps"), stretch.steps, ("k",))
    for i, item in enumerate(stretch.noise):
        try:
            item.check(continuous=stretch.continuous)
        except Problem as problem:
            raise Problem((*stretch.paths["noise"], i, *problem.path), problem.message) from problem
    return stretch


def _check(path: KeyPath, text: str, names: tuple[str, ...]) -> None:
    try:
        expression = parse(text, names=names)
        if not expression.names:
            expression.number()
    except ExpressionError as error:
        raise Problem(path, str(error)) from error
