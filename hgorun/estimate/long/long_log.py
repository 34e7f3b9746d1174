"""Logs of very many samples: carried out stretch by stretch, each from where the one before has ended.

The numbers are those of the whole at once, bit by bit. Nothing as long as the log is held in memory beside it:
estimates and innovations are written as they come. At the end the innovations are read again, output by output, and
the bands that follow from them are written. The error of the integration is told from some of the stretches, each of
which begins without one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from hgorun.ahead import ahead
from hgorun.config.yaml_source import Source
from hgorun.data.recording import Recording, Signal
from hgorun.engine.memory import Raw
from hgorun.engine.methods import METHODS
from hgorun.estimate.carrying import HALVINGS, LOST_HALVINGS, Carried, estimates, lost_apart
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import result_of, without_sensitivity
from hgorun.estimate.long.long_found import Found, Sweep, together
from hgorun.estimate.long.passed import Passed, carried_on, passed
from hgorun.estimate.long.planned import planned
from hgorun.estimate.long.stretches import LONG, Stretches, count_of, is_plain
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled
from hgorun.estimate.scores.assessed import Widths, widths_of
from hgorun.estimate.scores.compared import between_shown, compared_with, inside, instruments_of, see, unseen, with_lag
from hgorun.estimate.scores.evaluated import Evaluated, first_undefined, innovations_of
from hgorun.estimate.scores.innovations import WrittenInnovations
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.estimate.scores.scores import scores_of
from hgorun.native.rows import around, in_one_piece
from hgorun.result.file.parts import ResultInParts
from hgorun.result.records.recorded import Assessed, Recorded
from hgorun.result.result import Result
from hgorun.simulation.outcome.outcome import internal
from hgorun.symbolic.evaluate import Floats

_ROWS = 1 << 15  # of a band that are written at a time


def estimate_into(
    source: Source,
    recording: Recording,
    path: Path,
    *,
    name: str,
    text: str,
    held_out: Mapping[str, Signal],
    sensitivity: bool,
) -> Result | None:
    """Write the estimates of a long log while it is gone through; arguments as of :func:`~hgorun.estimate.estimate`.

    Returns
    -------
    Result or None
        With every so many of its points and samples; None where the log is short, or needs to be carried out as a
        whole.
    """
    if count_of(recording) <= LONG:
        return None
    experiment = completed(source, recording, name, text)
    with experiment.located():
        if not is_plain(experiment, recording):
            return None
        log = LongLog(Stretches(experiment, recording), recording, held_out, sensitivity=sensitivity)
        return log.written(path)


class _TooCoarse(Exception):
    """The error is larger than was asked for."""


class LongLog:
    """A log that is gone through.

    Parameters
    ----------
    stretches : Stretches
    recording : Recording
    held_out : mapping of str to Signal
    sensitivity : bool
        Whether it is to be said that no other gains are tried.
    """

    def __init__(
        self, stretches: Stretches, recording: Recording, held_out: Mapping[str, Signal], *, sensitivity: bool
    ) -> None:
        self._stretches, self._recording = stretches, recording
        self._prepared = replace(stretches.first, samples=tuple(stretches.samples), inputs=None)
        self._sensitivity = sensitivity
        self._halvings = 0
        experiment = self._prepared.experiment
        of_inputs = [(one.times, experiment.origin) for one in recording.inputs.values()]
        self._grid = OutputPoints.of(experiment, [*((one.taken, 0.0) for one in stretches.samples), *of_inputs])
        signals = {(0, name): one for name, one in held_out.items()}
        signals |= {(1, name): one for name, one in recording.reference.items()}
        self._span = experiment.origin, experiment.time.end
        self._signals = signals
        self._asked = {key: inside(signal, *self._span, self._grid) for key, signal in signals.items()}
        self._held_out = held_out
        self._set_aside = {name: one.values.size for name, one in held_out.items()}

    def written(self, path: Path) -> Result:
        """Carry it out, with steps that are halved until they are short enough, and write the result."""
        prepared = self._prepared
        solver, step, spent = prepared.run.solver, prepared.run.step, 0
        for left in range(HALVINGS - 1, -1, -1):
            own, found = self._begin(), self._nothing_yet()
            try:
                with ResultInParts(path, len(prepared.run.observers)) as file:
                    self._write_constants(file)
                    with closing(self._go_through(own, step, found, file)) as evaluations:
                        told: tuple[int, int] | None = None
                        for sofar in evaluations:
                            if not left or 2 * (spent + sofar) > solver.max_evaluations:
                                continue
                            before, told = told, (found.comparisons, len(found.steps))
                            if told != before and not self._enough(found):  # of which most stretches tell nothing new
                                raise _TooCoarse
                    return self._finish(file, own, found, step, spent + sofar)
            except _TooCoarse:
                spent, step = spent + sofar, step / 2
                self._halvings += 1
        raise AssertionError("the last one is taken as it is")

    def _go_through(self, own: Sweep, step: float, found: Found, file: ResultInParts) -> Generator[int]:
        """Carry out, tell and write stretch by stretch; after each the evaluations so far."""
        other, evaluations = self._begin(), len(METHODS[self._prepared.method].c)
        instruments = list(found.instruments.values())
        between = between_shown(self._prepared, instruments)
        with (
            ahead(planned(self._stretches, self._grid, self._asked, step, instruments, between)) as stretches,
            # two, since some stretches take longer to tell of than to carry out
            ahead(passed(stretches, own), 2) as passes,
        ):
            for one in passes:
                self._tell(one, step, other, found, file)
                yield (one.tries + other.tries) * evaluations

    def _write_constants(self, file: ResultInParts) -> None:
        """What is the same of all samples: each is used, and no observer knows the variance of its innovations.

        Each is known when it is taken, and the outputs of one clock share their times.
        """
        for i, one in enumerate(self._prepared.samples):
            base, shape = f"measurement/{one.output}", (one.values.size, len(self._prepared.run.observers))
            file.constant(f"{base}/used", shape, np.int8(1))
            file.constant(f"{base}/nis", shape, np.float64(np.nan))
            first = self._clock(i)
            of = f"measurement/{self._prepared.samples[first].output}"
            if first < i:
                file.same(f"{base}/number", f"{of}/number")
                file.same(f"{base}/time", f"{of}/time")
            file.same(f"{base}/taken", f"{of}/time")
            file.same(f"{base}/available", f"{of}/time")

    def _clock(self, output: int) -> int:
        """The first output that is measured when one is."""
        samples = self._prepared.samples
        return next(k for k, one in enumerate(samples) if one.taken is samples[output].taken)

    def _begin(self) -> Sweep:
        run = self._prepared.run
        return Sweep(z=run.numbers.z0, w=None, diverged=np.full(len(run.observers), np.inf))

    def _nothing_yet(self) -> Found:
        run = self._prepared.run
        instruments = instruments_of(self._prepared, self._signals, self._asked)
        return Found.begin(len(run.observers), len(run.plant.model.states), self._asked, instruments)

    def _tell(self, one: Passed, step: float, other: Sweep, found: Found, file: ResultInParts) -> None:
        """Tell and write what a stretch gives, with ``other`` steps as well where that is planned."""
        stretch, raw = one.planned, one.raw
        prepared, times, grid = stretch.stretch.prepared, stretch.times, stretch.grid
        everywhere = estimates(prepared, times, raw)
        if stretch.beside is not None:
            other.z, other.w, other.largest = one.z, one.w, one.largest
            beside = carried_on(prepared, stretch.beside, other)
            found.compare(everywhere, estimates(prepared, times, beside))
            if prepared.run.solver.divergence is None:  # a given bound is meant as it is
                found.by_steps |= lost_apart(raw.diverged[:, 0], beside.diverged[:, 0])
        found.steps |= stretch.steps
        for key, (taken, values) in stretch.aside.items():
            at = np.searchsorted(times, taken)
            found.compared[key].append(compared_with(prepared, key[1], taken, values, [x[at] for x in everywhere]))
        see(prepared, found.instruments, times, everywhere)
        on_grid = slice(None) if times is grid else np.searchsorted(times, grid)
        shown = [in_one_piece(x[on_grid]) for x in everywhere]
        for j, x in enumerate(shown):
            found.undefined[j] = min(found.undefined[j], first_undefined(grid, x))
        for path, rows in self._along_time(prepared, grid, shown, raw.rows[on_grid, :, 0]):
            self._write(file, found, path, rows, self._grid.size)
        used = np.zeros(0, dtype=bool)  # all samples are, and no one asks
        carried = Carried(raw, used, used, step, one.end, 0)
        for i, sampled in enumerate(prepared.samples):
            predicted = innovations_of(prepared, i, times, everywhere, carried)
            first = found.done.setdefault((i, ""), 0)
            found.done[i, ""] += sampled.values.size
            for path, rows in self._of_output(i, sampled, first, predicted):
                self._write(file, found, path, rows, self._prepared.samples[i].values.size)

    def _enough(self, found: Found) -> bool:
        """Whether steps are short enough so far."""
        solver = self._prepared.run.solver
        if not solver.controlled:
            return True
        lost = np.any(found.by_steps) and self._halvings < LOST_HALVINGS
        return not lost and bool(np.all(found.error(self._prepared.method) <= solver.accuracy))

    def _along_time(
        self, prepared: PreparedEstimate, grid: Floats, xhat: Sequence[Floats], rows: Floats
    ) -> Iterator[tuple[str, np.ndarray]]:
        """What is written of a stretch on the output grid, with the paths of its data sets."""
        yield "time", prepared.run.origin + grid
        if prepared.run.plant.model.inputs:
            yield "plant/u", prepared.u(grid)
        of = {b.label: j for j, b in enumerate(prepared.run.observers)}
        for label in prepared.experiment.observers:
            yield f"observers/{label}/xhat", xhat[of[label]]
            for name, values in internal(prepared.run.observers[of[label]], rows).items():
                yield f"observers/{label}/state/{name}", values

    def _of_output(self, i: int, one: Sampled, first: int, predicted: Floats) -> Iterator[tuple[str, np.ndarray]]:
        """What is written of the samples of output i, the first of which has a number."""
        base, some = f"measurement/{one.output}", slice(first, first + one.taken.size)
        if self._clock(i) == i:
            yield f"{base}/number", np.arange(some.start, some.stop)
            yield f"{base}/time", self._stretches.stamps[i][some]
        yield f"{base}/y", one.values
        yield f"{base}/innovation", predicted.T

    def _finish(self, file: ResultInParts, own: Sweep, found: Found, step: float, spent: int) -> Result:
        """What is told at the end, and the bands."""
        prepared, span = self._prepared, self._span
        m = len(prepared.run.observers)
        nothing, count = np.zeros((0, 1)), sum(one.values.size for one in prepared.samples)
        raw = Raw(np.zeros((0, own.z.size, 1)), nothing, own.diverged[:, None], nothing, nothing)
        used = np.broadcast_to(np.True_, (count, m))
        whole = {key: with_lag(together(parts), found.instruments.get(key)) for key, parts in found.compared.items()}
        shown = found.all_shown
        predicted = [
            WrittenInnovations(file.whole(f"measurement/{one.output}/innovation"), one.values.size)
            for one in prepared.samples
        ]
        evaluated = Evaluated(
            Carried(raw, used, used, step, found.error(prepared.method), spent, by_steps=found.by_steps),
            self._grid[:0],
            [shown(f"observers/{b.label}/xhat") for b in prepared.run.observers],
            np.zeros((0, own.z.size)),
            predicted,
            {name: one for (which, name), one in whole.items() if which == 0},
            {name: one for (which, name), one in whole.items() if which == 1},
            [None] * m,
            found.undefined,
        )
        assessed = [self._assess(file, evaluated, found, j) for j in range(m)]
        outputs = {
            one.output: found.samples(one.output, prepared.samples[self._clock(i)].output)
            for i, one in enumerate(prepared.samples)
        }
        reference = unseen(self._recording.reference, *span)
        recorded = Recorded(outputs, unseen(self._held_out, *span), reference, self._recording.origin.text)
        result = result_of(prepared, self._recording, evaluated, assessed, recorded, self._set_aside)
        result = replace(result, time=shown("time"), u=shown("plant/u") if result.inputs else result.u)
        if self._sensitivity:
            result = without_sensitivity(result, count)
        file.finish(result)
        return result

    def _assess(self, file: ResultInParts, evaluated: Evaluated, found: Found, j: int) -> Assessed:
        """The scores of an observer, and its band, which is written meanwhile."""
        prepared, label = self._prepared, self._prepared.run.observers[j].label
        with ThreadPoolExecutor(1) as pool:
            scores = pool.submit(scores_of, prepared, evaluated, j, spare=True)
            widths = widths_of(prepared, evaluated, j)
            self._write_band(file, found, label, widths)
            lower, upper = (found.all_shown(f"observers/{label}/{name}") for name in ("lower", "upper"))
            return Assessed(lower, upper, widths.reasons, scores.result())

    @staticmethod
    def _write(file: ResultInParts, found: Found, path: str, rows: np.ndarray, total: int) -> None:
        """Write rows of a data set, and keep those that are shown."""
        found.keep(path, rows, total)
        file.append(path, rows, total, lasting=True)

    def _write_band(self, file: ResultInParts, found: Found, label: str, widths: Widths) -> None:
        written = file.whole(f"observers/{label}/xhat")
        for some, width in widths.in_pieces(self._grid, _ROWS):
            bounds = around(written.read(some.start, some.stop), width)
            for name, rows in zip(("lower", "upper"), bounds, strict=True):
                self._write(file, found, f"observers/{label}/{name}", rows, self._grid.size)
