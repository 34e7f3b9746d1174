"""``estimate CONFIG -``: samples from standard input, estimates to standard output, as they come."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Iterator
from contextlib import nullcontext

from hgorun.commands.held import held_alone
from hgorun.commands.outputs import NOT_OK
from hgorun.commands.run_options import Estimate
from hgorun.commands.stream_lines import Block, CsvForm, JsonForm, Sample, Samples, read
from hgorun.commands.stream_progress import InOrder
from hgorun.commands.stream_samples import REMEMBERED, OneByOne, Stream, Writer, refuse_results, tell_left_out
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.process import uninterrupted

_FEW = 3  # lines that are not worth being taken together
_SECONDS = 1.0  # between two checkpoints


def follow(source: Source, name: str, options: Estimate) -> int:
    """Follow the stream to its end, and say with ``strict`` whether all has been as it should be."""
    refuse_results(options)
    if options.publish is not None or options.client_id is not None:
        raise ConfigError("--publish and --client-id are for brokers: hgorun estimate CONFIG mqtt://HOST/TOPIC")
    with nullcontext() if options.checkpoint is None else held_alone(options.checkpoint):
        return _follow_to_end(source, name, options)


def _follow_to_end(source: Source, name: str, options: Estimate) -> int:
    stream = Stream.of(source, name)
    stream.tell_what_is_ignored()
    form, late, blocks = read(sys.stdin)
    if late:
        stream.check_lateness(told=isinstance(form, CsvForm))  # which has the column then
    estimator = stream.estimator(remembered=(options.remembered or REMEMBERED) if late else 0)
    progress = InOrder(estimator, options.checkpoint, stream.unit)
    writer = Writer(sys.stdout, estimator, as_json=isinstance(form, JsonForm))
    one_by_one = OneByOne.of(stream, estimator, options.every, progress, writer)
    try:
        _follow(form, blocks, one_by_one, progress)
    except (ConfigError, KeyboardInterrupt, SystemExit):  # between two samples: both are as they should be
        progress.save_what_there_is()
        tell_left_out(one_by_one, stream)
        raise
    progress.save()
    tell_left_out(one_by_one, stream)
    return NOT_OK if options.strict and not one_by_one.all_ok else 0


def _follow(form: CsvForm | JsonForm, blocks: Iterator[Block], one_by_one: OneByOne, progress: InOrder) -> None:
    estimator, whole = one_by_one.estimator, one_by_one.grid.step is None
    saved = clock.monotonic()
    for lines in blocks:
        known = form.together(lines, estimator.kinds) if whole and len(lines.lines) > _FEW else None
        if known is None:
            for sample in form.samples(lines):
                one_by_one.take(sample)
        else:
            _take_together(known, lines, one_by_one, progress)
        with uninterrupted():
            sys.stdout.flush()
        if clock.monotonic() - saved > _SECONDS:
            progress.save()
            saved = clock.monotonic()


def _take_together(known: Samples, block: Block, one_by_one: OneByOne, progress: InOrder) -> None:
    """Samples that are there already: many in one call, and one by one where they cannot be."""
    estimator, writer = one_by_one.estimator, one_by_one.writer
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
                one_by_one.note_times(some, signals)
        else:
            line = block.first + int(behind[at])
            one_by_one.take(Sample(line, float(t[at]), signals[kinds[at]], float(y[at]), None))
        at += max(count, 1)
