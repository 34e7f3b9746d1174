"""What pipes and brokers have in common: samples are taken one by one, and estimates are written as lines."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Self, TextIO

import numpy as np

from hgorun.commands.mqtt_address import is_address
from hgorun.commands.run_options import Estimate
from hgorun.commands.stream_clock import AGAIN, UTC
from hgorun.commands.stream_grid import Grid
from hgorun.commands.stream_ignored import beginnings, ignored
from hgorun.commands.stream_lines import INPUT, Sample, Samples
from hgorun.commands.stream_progress import Progress
from hgorun.commands.stream_watch import Watch
from hgorun.config.yaml_source import Source
from hgorun.data.faults.clock_changes import PUT_FORWARD
from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.scores.shut_out import told_row, too_many, too_small
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.stream.estimator import Estimator
from hgorun.estimate.stream.first_told import NoStart
from hgorun.estimate.stream.lateness import why_refused
from hgorun.observers.treatment import treatment_of
from hgorun.process import say, uninterrupted
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import Floats

REMEMBERED = 1000
"""Events that late samples may go back to, if nothing else is said."""


@dataclass(frozen=True, eq=False, repr=False)
class Stream:
    """What a configuration says of a stream.

    Attributes
    ----------
    experiment : Experiment
    said : StatedOfData
        What the block ``data`` says of samples.
    late : bool
        Whether the configuration says that samples are known later than they are taken.
    ignored : tuple of str
        What the block ``data`` says of files that does not happen to samples of a stream.
    """

    experiment: Experiment
    said: StatedOfData
    late: bool = False
    ignored: tuple[str, ...] = ()

    @classmethod
    def of(cls, source: Source, name: str) -> Stream:
        """That of a configuration.

        Raises
        ------
        ConfigError
        """
        said = StatedOfData.of(source)
        experiment = streamed(source, said, name)
        if said.block is None:
            return cls(experiment, said)
        late = any(one.available is not None for one in said.block.outputs.values())
        return cls(experiment, said, late, tuple(ignored(said.block, experiment)))

    def check_lateness(self, *, told: bool = False) -> None:
        """Refuse observers that treat late samples differently where these come; where they may come, tell of it.

        Parameters
        ----------
        told : bool
            Whether the stream says that samples are late. Any object of JSON may be of one; that such come is known
            beforehand only where ``data.outputs.*.available`` stands.

        Raises
        ------
        ConfigError
        """
        different = why_refused(self.experiment)
        if different is None:
            return
        if told or self.late:
            with self.experiment.located():
                raise different
        say(f"hgorun: {self.experiment.name}: late samples will be refused: {different.message}")

    def tell_what_is_ignored(self) -> None:
        """On stderr: the estimates are other ones than those of a file."""
        for words in self.ignored:
            say(f"hgorun: {self.experiment.name}: {words}")

    @property
    def unit(self) -> str:
        """That of times."""
        return self.experiment.blocks.time.unit

    def estimator(self, *, remembered: int) -> Estimator:
        """At the start of the stream; ``remembered`` is 0 where no sample can be late."""
        said = self.said
        return Estimator(self.experiment, gates=said.gates, std=said.std, inputs=said.inputs, remembered=remembered)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Those that come with the samples."""
        return self.said.inputs


def refuse_results(options: Estimate) -> None:
    """What a stream does not have."""
    if len(options.data) > 1:
        stream = next(one for one in options.data if one == "-" or is_address(one))
        raise ConfigError(f"{stream} is a stream; there are no files beside it")
    if options.asks_for_a_result:
        raise ConfigError("a stream writes no result: leave out --holdout, --export-csv and --output")
    if options.export_samples is not None:
        raise ConfigError("--export-samples writes the samples of files, and those of a stream are lines already")
    if options.json:
        raise ConfigError("--json is for results: a stream is answered in its own form, so send objects of JSON")
    if options.every is not None and not 0 < options.every < math.inf:
        raise ConfigError(f"--every: expected a time above 0, found {options.every:g}")


@dataclass(frozen=True)
class OneByOne:
    """What becomes of single samples."""

    estimator: Estimator
    inputs: tuple[str, ...]
    grid: Grid
    progress: Progress
    writer: Writer
    watch: Watch

    @classmethod
    def of(cls, stream: Stream, estimator: Estimator, every: float | None, progress: Progress, writer: Writer) -> Self:
        """Of a stream that begins, or goes on where it had come."""
        grid = Grid(stream.experiment.origin, every, progress.t)
        is_new = progress.t == -math.inf
        if is_new and stream.said.block is not None:
            for words in beginnings(stream.experiment):
                say(f"hgorun: {stream.experiment.name}: {words}")
        watch = Watch(estimator, stream.inputs if is_new else ())
        return cls(estimator, stream.inputs, grid, progress, writer, watch)

    @property
    def all_ok(self) -> bool:
        """Whether all that has been told is as it should be; as of a file, a gate may leave out some samples."""
        many = any(too_many(*counts) for _, _, counts in self.judged())
        return self.writer.all_ok and not self.estimator.any_lost and not many

    def judged(self) -> Iterator[tuple[str, str, tuple[int, int, int]]]:
        """By observer and output with a gate: how many samples were left out, of how many, and most one by one."""
        rows = self.estimator.gated_in_a_row
        for label, of_outputs in self.estimator.gated.items():
            for output, (left_out, offered) in of_outputs.items():
                yield label, output, (left_out, offered, rows[label][output])

    def take(self, sample: Sample) -> None:
        """Take a sample, and write what is known then."""
        clock = self.progress.clock
        if self.progress.knows(sample):
            return
        known = sample.t if sample.available is None else sample.available
        try:
            self.estimator.require_reachable(known)
            for t, estimates in self.estimator.predictions(self.grid.until(known)):
                with uninterrupted():
                    if t > self.progress.shown:  # else it was told before the stream was started again
                        self.writer.write(t, estimates)
                        self.progress.shown = t
            with uninterrupted():
                self._update(sample)
                self.progress.took(sample)
                self._tell(sample.signal, clock.took(sample.signal, sample.t))
                if not math.isnan(sample.y) or sample.signal not in self.inputs:
                    self.watch.took(sample.signal, sample.t)
                if self.grid.step is None:
                    self.writer.write(known, self.estimator.estimate())
        except NoStart as error:
            where = error.located
            message = f"{where.message} (with the inputs that have come by t = {sample.t:g})"
            raise ConfigError(message, file=where.file, line=where.line, key=where.key) from None
        except ValueError as error:
            again = f"; {AGAIN.format(sample.signal)}: {UTC}" if clock.back(sample.signal, sample.t) else ""
            raise ConfigError(f"{error}{again}", file=INPUT, line=sample.line) from None

    def note_times(self, samples: Samples, signals: list[str]) -> None:
        """Those of samples that have been taken together, in their order."""
        kinds = np.unique(samples.kinds).tolist()
        for kind in kinds:
            times = samples.t[samples.kinds == kind]
            self._tell(signals[kind], self.progress.clock.took_all(signals[kind], times))
        for kind in reversed(kinds):  # inputs first: they stand behind the outputs
            self.watch.took(signals[kind], float(samples.t[-1]))

    def _tell(self, signal: str, ahead: float | None) -> None:
        """What is told of the time of a signal that lies an hour ahead."""
        if ahead is not None:
            say(f"hgorun: {signal}, t = {ahead:.10g}: {PUT_FORWARD}; {UTC}")

    def _update(self, sample: Sample) -> None:
        if sample.signal in self.inputs:
            self.estimator.update(sample.t, {}, sample.available, {sample.signal: sample.y})
        else:
            self.estimator.update(sample.t, {sample.signal: sample.y}, sample.available)
            if sample.available is not None and sample.available > sample.t:
                self.progress.late[sample.signal] += 1


def tell_left_out(one_by_one: OneByOne, stream: Stream) -> None:
    """On stderr, at the end: how many samples gates have left out, and how many since they were late."""
    experiment = stream.experiment
    if all(treatment_of(observer) == "drop" for observer in experiment.observers.values()):
        for output, count in one_by_one.progress.late.items():
            left_out = f"{count} samples of {output} were left out since they were late (late: drop)"
            say(f"hgorun: {experiment.name}: {left_out}")
    for label, output, (count, offered, row) in one_by_one.judged():
        if count:
            why = told_row(row)
            if too_many(count, offered, row):
                small = too_small(experiment.observers[label], stream.said.gates[output])
                why += f", too many for outliers: look at their unit, the model, and {small}"
            say(f"hgorun: {label}: the gate of {output} left out {count} of {offered} samples{why}")


class Writer:
    """Writes estimates as lines, in the form of the input.

    Attributes
    ----------
    all_ok : bool
        Whether the status of all lines has been ``ok``.
    """

    def __init__(self, stream: TextIO, estimator: Estimator, *, as_json: bool) -> None:
        self._stream, self._estimator, self._as_json = stream, estimator, as_json
        self.all_ok = True
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
            self.all_ok &= status == "ok"
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
            self.all_ok &= bool(np.all(status == "ok"))
            numbers = [map(repr, column) for column in xhat.T.tolist()]
            found.append(map(",".join, zip(moments, repeat(label), *numbers, status.tolist())))
        self._stream.write("\n".join(chain.from_iterable(zip(*found, strict=True))) + "\n")
