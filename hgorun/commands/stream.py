"""``estimate CONFIG -``: samples from standard input, estimates to standard output, as they come."""

from __future__ import annotations

import json
import math
import sys
import time as clock
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from typing import TextIO

import numpy as np

from hgorun.commands.options import Estimate
from hgorun.commands.stream_lines import INPUT, Block, CsvForm, JsonForm, Sample, Samples, read
from hgorun.commands.stream_progress import Progress
from hgorun.config.data import Data
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimator import Estimator
from hgorun.process import uninterrupted
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
    progress = Progress(estimator, options.checkpoint)
    writer = Writer(sys.stdout, estimator, as_json=isinstance(form, JsonForm))
    grid = _Grid(experiment.origin, options.every, progress)
    one_by_one = _OneByOne(estimator, inputs, grid, progress, writer)
    try:
        _follow(form, blocks, one_by_one)
    except (ConfigError, KeyboardInterrupt, SystemExit):  # between two samples: both are as they should be
        progress.save_what_there_is()
        raise
    progress.save()
    return 0


def _follow(form: CsvForm | JsonForm, blocks: Iterator[Block], one_by_one: _OneByOne) -> None:
    estimator, whole = one_by_one.estimator, one_by_one.grid.step is None
    saved = clock.monotonic()
    for lines in blocks:
        known = form.together(lines, estimator.kinds) if whole and len(lines.lines) > _FEW else None
        if known is None:
            for sample in form.samples(lines):
                one_by_one.take(sample)
        else:
            _take_together(known, lines, one_by_one)
        with uninterrupted():
            sys.stdout.flush()
        if clock.monotonic() - saved > _SECONDS:
            one_by_one.progress.save()
            saved = clock.monotonic()


@dataclass(frozen=True)
class _OneByOne:
    """What becomes of single samples."""

    estimator: Estimator
    inputs: tuple[str, ...]
    grid: _Grid
    progress: Progress
    writer: Writer

    def take(self, sample: Sample) -> None:
        """Take a sample, and write what is known then."""
        if self.progress.knows(sample):
            return
        known = sample.t if sample.available is None else sample.available
        try:
            self.estimator.require_reachable(known)
            for t in self.grid.until(known):
                with uninterrupted():
                    self.writer.write(t, self.estimator.predict(t))
                    self.progress.shown = t
            with uninterrupted():
                self._update(sample)
                self.progress.took(sample)
                if self.grid.step is None:
                    self.writer.write(known, self.estimator.estimate())
        except ValueError as error:
            raise ConfigError(str(error), file=INPUT, line=sample.line) from None

    def _update(self, sample: Sample) -> None:
        if sample.signal in self.inputs:
            self.estimator.update(sample.t, {}, sample.available, {sample.signal: sample.y})
        else:
            self.estimator.update(sample.t, {sample.signal: sample.y}, sample.available)


def _take_together(known: Samples, block: Block, one_by_one: _OneByOne) -> None:
    """Samples that are there already: many in one call, and one by one where they cannot be."""
    estimator, progress, writer = one_by_one.estimator, one_by_one.progress, one_by_one.writer
    signals = list(estimator.kinds)
    behind = progress.unknown(known, signals)
    t, kinds, y = known.t[behind], known.kinds[behind], known.y[behind]
    at = 0
    while at < t.size:
        count = estimator.at_once(t[at:], kinds[at:])
        if count:
            part = slice(at, at + count)
            some = Samples(t[part], kinds[part], y[part])
            with uninterrupted():
                writer.write_many(some.t, estimator.update_many(*some))
                progress.took_all(some, signals)
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


class _Grid:
    """Multiples of a step: those that have not been shown, and are not before what has been reached already."""

    def __init__(self, origin: float, step: float | None, progress: Progress) -> None:
        self._origin, self.step, self._next = origin, step, 0
        begun = max(progress.t, progress.shown)
        if step is not None and begun > origin:
            self._next = max(math.floor((begun - origin) / step) - 1, 0)
            while (t := origin + self._next * step) < progress.t or t <= progress.shown:
                self._next += 1

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
