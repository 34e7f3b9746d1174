"""``estimate CONFIG -``: samples from standard input, estimates to standard output, as they come."""

from __future__ import annotations

import json
import math
import sys
import time as clock
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, TextIO

from hgorun.commands.options import Estimate
from hgorun.config.data import Data
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimator import Estimator
from hgorun.files import written_whole
from hgorun.symbolic.evaluate import Floats

_INPUT = "standard input"
_COLUMNS = ("t", "signal", "y", "available")
_REMEMBERED = 1000  # events that late samples may go back to
_SECONDS = 1.0  # between two checkpoints


class Sample(NamedTuple):
    """A line of the stream."""

    line: int
    t: float
    signal: str
    y: float
    available: float | None


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
    samples, as_json, late = lines_of(sys.stdin)
    estimator = Estimator(experiment, gates=gates, inputs=inputs, remembered=_REMEMBERED if late else 0)
    reached = -math.inf
    if options.checkpoint is not None and options.checkpoint.exists():
        estimator.restore(options.checkpoint.read_bytes())
        reached = estimator.t
    write = _writer(sys.stdout, estimator, as_json=as_json)
    saved = clock.monotonic()
    grid = _Grid(experiment.origin, options.every, reached)
    for sample in samples:
        known = sample.t if sample.available is None else sample.available
        if known <= reached:  # before the checkpoint
            continue
        for t in grid.until(known):
            write(t, estimator.predict(t))
        try:
            if sample.signal in inputs:
                estimator.update(sample.t, {}, sample.available, {sample.signal: sample.y})
            else:
                estimator.update(sample.t, {sample.signal: sample.y}, sample.available)
        except ValueError as error:
            raise ConfigError(str(error), file=_INPUT, line=sample.line) from None
        if options.every is None:
            write(known, estimator.estimate())
        if options.checkpoint is not None and clock.monotonic() - saved > _SECONDS:
            _save(estimator, options.checkpoint)
            saved = clock.monotonic()
    if options.checkpoint is not None:
        _save(estimator, options.checkpoint)
    return 0


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
        self._origin, self._step, self._next = origin, step, 0
        if step is not None and reached > origin:
            self._next = math.floor((reached - origin) / step) + 1

    def until(self, t: float) -> Iterator[float]:
        """Those before a time."""
        while self._step is not None and self._origin + self._next * self._step < t:
            yield self._origin + self._next * self._step
            self._next += 1


Writer = Callable[[float, Mapping[str, Floats]], None]


def _writer(stream: TextIO, estimator: Estimator, *, as_json: bool) -> Writer:
    """What writes estimates as lines, in the form of the input."""
    states = estimator.states
    if not as_json:
        stream.write(",".join(["t", "observer", *states, "status"]) + "\n")

    def write(t: float, estimates: Mapping[str, Floats]) -> None:
        lost = estimator.lost if estimator.any_lost else {}
        for label, xhat in estimates.items():
            numbers, status = xhat.tolist(), "ok"
            if lost.get(label):
                status = "diverged"
            elif not all(map(math.isfinite, numbers)):
                status = "undefined"
            if as_json:
                values = {s: v if math.isfinite(v) else None for s, v in zip(states, numbers, strict=True)}
                stream.write(json.dumps({"t": t, "observer": label, **values, "status": status}) + "\n")
            else:
                stream.write(f"{t!r},{label},{','.join(map(repr, numbers))},{status}\n")
        stream.flush()

    return write


def lines_of(stream: TextIO) -> tuple[Iterator[Sample], bool, bool]:
    """The samples of a stream, whether they are JSON, and whether some may be late.

    Raises
    ------
    ConfigError
        With the number of the line.
    """
    first = stream.readline()
    if first.lstrip().startswith("{"):
        return _json_lines(first, stream), True, True
    return _csv_lines(first, stream), False, _COLUMNS[3] in first


def _csv_lines(header: str, stream: TextIO) -> Iterator[Sample]:
    names = _cells(header.lstrip("\ufeff"))
    missing = [name for name in _COLUMNS[:3] if name not in names]
    if missing:
        raise ConfigError(
            f"expected the header t,signal,y[,available], found {header.strip()[:80]!r}", file=_INPUT, line=1
        )
    places = [names.index(name) if name in names else None for name in _COLUMNS]
    for number, line in enumerate(stream, start=2):
        cells = _cells(line)
        if cells == [""]:
            continue
        if len(cells) != len(names):
            raise ConfigError(f"expected {len(names)} cells, found {len(cells)}", file=_INPUT, line=number)
        t, signal, y, known = (None if place is None else cells[place] for place in places)
        yield _sample(number, t, signal, y, known or None)


def _cells(line: str) -> list[str]:
    """What stands between the commas, which are in no name and in no number."""
    return [cell.strip().strip('"') for cell in line.rstrip("\r\n").split(",")]


def _json_lines(first: str, stream: TextIO) -> Iterator[Sample]:
    number, line = 1, first
    while line:
        if line.strip():
            try:
                found = json.loads(line)
            except (ValueError, RecursionError) as error:
                raise ConfigError(f"not JSON: {error}", file=_INPUT, line=number) from None
            if not isinstance(found, dict):
                raise ConfigError("expected an object with t, signal and y", file=_INPUT, line=number)
            yield _sample(number, *(found.get(name) for name in _COLUMNS))
        number, line = number + 1, stream.readline()


def _sample(line: int, t: object, signal: object, y: object, available: object) -> Sample:
    if not isinstance(signal, str) or not signal:
        raise ConfigError(f"signal: expected a name, found {signal!r:.50}", file=_INPUT, line=line)
    known = None if available is None else _number(line, "available", available)
    value = float("nan") if y in ("", None) else _number(line, "y", y)
    return Sample(line, _number(line, "t", t), signal, value, known)


def _number(line: int, name: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]  # whatever it is, this says whether it is a number
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if isinstance(value, bool) or (name != "y" and not math.isfinite(number)) or math.isinf(number):
        raise ConfigError(f"{name}: expected a number, found {value!r:.50}", file=_INPUT, line=line)
    if name == "y" and number != number and str(value).strip().lower() != "nan":
        raise ConfigError(f"y: expected a number, found {value!r:.50}", file=_INPUT, line=line)
    return number
