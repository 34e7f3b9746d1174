"""The band of an estimate, state by state, and its scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled
from hgorun.estimate.scores.bands import FEWEST, Band, band_of
from hgorun.estimate.scores.evaluated import Evaluated
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.estimate.scores.row_left_out import in_a_row, outliers_at_start
from hgorun.estimate.scores.scores import scores_of, settled, settled_from, since
from hgorun.pieces import all_true
from hgorun.result.records.recorded import WIDE, Assessed, InARow
from hgorun.symbolic.evaluate import Floats

_RESIDUALS = 1 << 20  # that a band is made of, evenly chosen where there are more


def assess(prepared: PreparedEstimate, found: Evaluated, j: int) -> Assessed:
    """The band and the scores of observer j."""
    scores, normal = scores_of(prepared, found, j), found.normal[j]
    xhat = found.xhat[j]
    if normal is not None:
        width = WIDE * normal.deviation
        for i, (one, nis) in enumerate(zip(prepared.samples, normal.nis, strict=True)):
            sound = settled(nis[found.carried.used[prepared.slots[i], j]])
            if sound.size:
                scores.setdefault("nis", {})[one.output] = float(np.mean(sound))
        return Assessed(xhat - width, xhat + width, {}, scores, *_left_out(prepared, found, j))
    widths = widths_of(prepared, found, j)
    width = widths.at(found.grid)
    return Assessed(xhat - width, xhat + width, widths.reasons, scores, *_left_out(prepared, found, j))


def _left_out(prepared: PreparedEstimate, found: Evaluated, j: int) -> tuple[Mapping[str, InARow], Mapping[str, int]]:
    """The samples that gates have left out: those one after the other, and how many of the first ones are outliers."""
    rows = in_a_row(prepared, found.carried, j)
    return rows, outliers_at_start(prepared, found.carried, j) if rows else {}


@dataclass(frozen=True, eq=False, repr=False)
class Widths:
    """Half the width of the band of every state.

    Attributes
    ----------
    bands : sequence of sequence of (Band, Sampled or None)
        Of every state; each with the samples since the last of which it grows. The narrowest counts.
    reasons : mapping of str to str
        By state, why it has no band.
    """

    bands: Sequence[Sequence[tuple[Band, Sampled | None]]]
    reasons: Mapping[str, str]

    def at(self, grid: Floats) -> Floats:
        """At some times, shape (len(grid), n); NaN where there is no band."""
        width = np.full((grid.size, len(self.bands)), np.nan)
        known: dict[int, Floats] = {}  # by the clocks that outputs share
        for k, bands in enumerate(self.bands):
            found = [_at(band, one, grid, known) for band, one in bands]
            if found:
                width[:, k] = found[0] if len(found) == 1 else np.min(np.broadcast_arrays(*found), axis=0)
        return width

    def in_pieces(self, grid: OutputPoints, rows: int) -> Iterator[tuple[slice, Floats]]:
        """Along a grid, so many points at a time, each piece with its first point and the one behind it.

        A row for each of them, or one for all where no band grows.
        """
        grow = any(band.level is None for bands in self.bands for band, _ in bands)
        same = self.at(grid[:1])[0]
        for first in range(0, grid.size, rows):
            some = slice(first, min(first + rows, grid.size))
            yield some, self.at(grid[some]) if grow else same


def _at(band: Band, one: Sampled | None, grid: Floats, known: dict[int, Floats]) -> Floats | float:
    """Half the width of a band at some times; of one that does not grow nothing is asked about samples."""
    if band.level is not None:
        return band.level
    if one is None:
        return band.at(np.zeros(grid.size))
    clock = id(one.heard[0])
    if clock not in known:
        known[clock] = since(one, grid)
    return band.at(known[clock])


def widths_of(prepared: PreparedEstimate, found: Evaluated, j: int) -> Widths:
    """The bands of an observer that knows nothing of its own errors."""
    model = prepared.run.plant.model
    every: list[list[tuple[Band, Sampled | None]]] = []
    known: dict[tuple[int, ...], Floats] = {}
    reasons = {}
    for state in model.states:
        outputs = [i for i, name in enumerate(model.outputs) if model.measures.get(name) == state]
        bands: list[tuple[Band | None, Sampled | None]] = [
            (_band(prepared, found, j, i, known), prepared.samples[i]) for i in outputs
        ]
        aside = found.held_out.get(state)
        if not outputs and aside is not None:  # what is not measured on line may have been measured otherwise
            bands.append((band_of(aside.residuals[j], np.zeros(aside.taken.size)), None))
        every.append([(band, one) for band, one in bands if band is not None])
        if not every[-1]:
            few = f"fewer than {FEWEST} samples say how far off the estimate is"
            reasons[state] = few if bands else "nothing measures this state"
    return Widths(every, reasons)


def _band(
    prepared: PreparedEstimate, found: Evaluated, j: int, output: int, known: dict[tuple[int, ...], Floats]
) -> Band | None:
    """The band of an output.

    From samples that were held out where there are enough, and otherwise from those that were used, each compared with
    what had been estimated without it. ``known``: how long ago the sample before was taken, by the clocks that outputs
    share.
    """
    sampled = prepared.samples[output]
    aside = found.held_out.get(sampled.output)
    if aside is not None:
        return band_of(aside.residuals[j], since(sampled, aside.taken))
    predicted, taken, used = found.predicted[output], sampled.taken, found.carried.used[prepared.slots[output], j]
    all_used = all_true(used)
    taken = taken if all_used else taken[used]
    late = settled_from(taken.size)
    chosen = slice(late, None, max(1, -(-(taken.size - late) // _RESIDUALS)))
    if not all_used:
        return band_of(predicted.of(j)[used][chosen], since(sampled, taken[chosen], before=True))
    clock = id(sampled.taken), id(sampled.available)  # which live as long as the run
    if clock not in known:
        known[clock] = since(sampled, taken[chosen], before=True)
    return band_of(predicted.of(j, chosen), known[clock])
