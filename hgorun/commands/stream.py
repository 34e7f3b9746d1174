"""``estimate CONFIG -``: samples from standard input, estimates to standard output, as they come."""

from __future__ import annotations

import json
import math
import sys
import time as clock
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path
from typing import TextIO

import numpy as np

from hgorun.commands.options import Estimate
from hgorun.commands.stream_lines import INPUT, Block, JsonForm, Sample, Samples, read
from hgorun.config.data import Data
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimator import Estimator
from hgorun.files import written_whole
from hgorun.symbolic.evaluate import Floats

_REMEMBERED = 1000  # events that late samples may go back to
_FEW = 3  # lines that are not worth being taken together
_SECONDS = 1.0  # between two checkpoints


def follow(source: Source, name: str, options: Estimate) -> int:
    """Follow the stream to its end."""
    _refuse(options)
    data = source.data.get("data") if isinstance(source.data, dict) else None
    block = None if data is None else validate(Data, data, source, ("data",))
    outputs = {} if block is None else block.outputs
    inputs = () if block is None else tuple(block.inputs)
    deviations = {output: one.std for output, one in outputs.items() if one.std is not None}
    experiment = streamed(source, inputs, deviations, name)
    gates = {output: one.gate for output, one in outputs.items() if one.gate is not None}
    form, late, blocks = read(sys.stdin)
    estimator = Estimator(experiment, gates=gates, inputs=inputs, remembered=_REMEMBERED if late else 0)
    reached = -math.inf
    if options.checkpoint is not None and options.checkpoint.exists():
        estimator.restore(options.checkpoint.read_bytes())
        reached = estimator.t
    writer = Writer(sys.stdout, estimator, as_json=isinstance(form, JsonForm))
    grid = _Grid(experiment.origin, options.every, reached)
    one_by_one = _OneByOne(estimator, inputs, grid, reached, writer)
    saved = clock.monotonic()
    for lines in blocks:
        known = form.together(lines, estimator.kinds) if options.every is None and len(lines.lines) > _FEW else None
        if known is None:
            for sample in form.samples(lines):
                one_by_one.take(sample)
        else:
            _take_together(known, lines, estimator, one_by_one)
        sys.stdout.flush()
        if options.checkpoint is not None and clock.monotonic() - saved > _SECONDS:
            _save(estimator, options.checkpoint)
            saved = clock.monotonic()
    if options.checkpoint is not None:
        _save(estimator, options.checkpoint)
    return 0


@dataclass(frozen=True)
class _OneByOne:
    """What becomes of single samples; those up to the time that was ``reached`` by a checkpoint are known."""

    estimator: Estimator
    inputs: tuple[str, ...]
    grid: _Grid
    reached: float
    writer: Writer

    def take(self, sample: Sample) -> None:
        """Take a sample, and write what is known then."""
        known = sample.t if sample.available is None else sample.available
        if known <= self.reached:
            return
        for t in self.grid.until(known):
            self.writer.write(t, self.estimator.predict(t))
        try:
            if sample.signal in self.inputs:
                self.estimator.update(sample.t, {}, sample.available, {sample.signal: sample.y})
            else:
                self.estimator.update(sample.t, {sample.signal: sample.y}, sample.available)
        except ValueError as error:
            raise ConfigError(str(error), file=INPUT, line=sample.line) from None
        if self.grid.step is None:
            self.writer.write(known, self.estimator.estimate())


def _take_together(known: Samples, block: Block, estimator: Estimator, one_by_one: _OneByOne) -> None:
    """Samples that are there already: many in one call, and one by one where they cannot be."""
    signals = list(estimator.kinds)
    behind = np.flatnonzero(known.t > one_by_one.reached)
    t, kinds, y = known.t[behind], known.kinds[behind], known.y[behind]
    at = 0
    while at < t.size:
        count = estimator.at_once(t[at:], kinds[at:])
        if count:
            part = slice(at, at + count)
            one_by_one.writer.write_many(t[part], estimator.update_many(t[part], kinds[part], y[part]))
        else:
            line = block.first + int(behind[at])
            one_by_one.take(Sample(line, float(t[at]), signals[kinds[at]], float(y[at]), None))
        at += max(count, 1)


def _refuse(options: Estimate) -> None:
    """What a stream does not have."""
    if len(options.data) > 1:
        raise ConfigError("- is standard input; there are no files beside it")
    if options.holdout or options.export_csv is not None or options.output is not None:
        raise ConfigError("of a stream no result is written: leave --holdout, --export-csv and --output out")
    if options.every is not None and not 0 < options.every < math.inf:
        raise ConfigError(f"--every: expected a time above 0, found {options.every:g}")


def _save(estimator: Estimator, path: Path) -> None:
    sys.stdout.flush()  # what is in the checkpoint has been told
    with written_whole(path) as part:
        part.write_bytes(estimator.checkpoint())


class _Grid:
    """Multiples of a step, behind what has been reached already."""

    def __init__(self, origin: float, step: float | None, reached: float) -> None:
        self._origin, self.step, self._next = origin, step, 0
        if step is not None and reached > origin:
            self._next = math.floor((reached - origin) / step) + 1

    def until(self, t: float) -> Iterator[float]:
        """Those before a time."""
        while self.step is not None and self._origin + self._next * self.step < t:
            yield self._origin + self._next * self.step
            self._next += 1


class Writer:
    """Writes estimates as lines, in the form of the input."""

    def __init__(self, stream: TextIO, estimator: Estimator, *, as_json: bool) -> None:
        self._stream, self._estimator, self._as_json = stream, estimator, as_json
        if not as_json:
            stream.write(",".join(["t", "observer", *estimator.states, "status"]) + "\n")

    def write(self, t: float, estimates: Mapping[str, Floats]) -> None:
        """The estimates of all observers at a time."""
        lost = self._estimator.lost if self._estimator.any_lost else {}
        for label, xhat in estimates.items():
            numbers, status = xhat.tolist(), "ok"
            if lost.get(label):
                status = "diverged"
            elif not all(map(math.isfinite, numbers)):
                status = "undefined"
            if self._as_json:
                states = zip(self._estimator.states, numbers, strict=True)
                values = {s: v if math.isfinite(v) else None for s, v in states}
                self._stream.write(json.dumps({"t": t, "observer": label, **values, "status": status}) + "\n")
            else:
                self._stream.write(f"{t!r},{label},{','.join(map(repr, numbers))},{status}\n")

    def write_many(self, times: Floats, estimates: Mapping[str, tuple[Floats, np.ndarray]]) -> None:
        """Those at many times, as CSV; with them whether an observer had no numbers any more."""
        moments, found = list(map(repr, times.tolist())), []
        for label, (xhat, lost) in estimates.items():
            status = np.where(lost, "diverged", np.where(np.isfinite(xhat).all(axis=1), "ok", "undefined"))
            numbers = [map(repr, column) for column in xhat.T.tolist()]
            found.append(map(",".join, zip(moments, repeat(label), *numbers, status.tolist())))
        self._stream.write("\n".join(chain.from_iterable(zip(*found, strict=True))) + "\n")
