"""The band of an estimate, state by state, and its scores."""

from __future__ import annotations

import numpy as np

from hgorun.estimate.bands import FEWEST, band_of
from hgorun.estimate.evaluated import Evaluated
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.scores import scores_of, settled, since
from hgorun.result.recorded import Assessed
from hgorun.symbolic.evaluate import Floats

_WIDE = 1.959963984540054  # standard deviations to either side that hold 95 % of normal numbers


def assess(prepared: PreparedEstimate, found: Evaluated, j: int) -> Assessed:
    """The band and the scores of observer j."""
    scores, normal = scores_of(prepared, found, j), found.normal[j]
    xhat = found.xhat[j]
    if normal is not None:
        width = _WIDE * normal.deviation
        for i, (one, nis) in enumerate(zip(prepared.samples, normal.nis, strict=True)):
            sound = settled(nis[found.carried.used[prepared.slots[i], j]])
            if sound.size:
                scores.setdefault("nis", {})[one.output] = float(np.mean(sound))
        return Assessed(xhat - width, xhat + width, {}, scores)
    model = prepared.run.plant.model
    width, reasons = np.full(xhat.shape, np.nan), {}
    for k, state in enumerate(model.states):
        outputs = [i for i, name in enumerate(model.outputs) if model.measures.get(name) == state]
        widths = [_width(prepared, found, j, i) for i in outputs]
        aside = found.held_out.get(state)
        if not outputs and aside is not None:  # what is not measured on line may have been measured otherwise
            band = band_of(aside.residuals[j], np.zeros(aside.taken.size))
            widths.append(None if band is None else band.at(np.zeros(xhat.shape[0])))
            outputs = [-1]
        known = [one for one in widths if one is not None]
        if known:
            width[:, k] = np.min(known, axis=0)
        elif outputs:
            reasons[state] = f"fewer than {FEWEST} samples say how far off the estimate is"
        else:
            reasons[state] = "nothing measures this state"
    return Assessed(xhat - width, xhat + width, reasons, scores)


def _width(prepared: PreparedEstimate, found: Evaluated, j: int, output: int) -> Floats | None:
    """Half the width of the band of an output, on the output grid.

    From samples that were held out where there are enough, and otherwise from those that were used, each compared with
    what had been estimated without it.
    """
    sampled = prepared.samples[output]
    aside = found.held_out.get(sampled.output)
    if aside is not None:
        band = band_of(aside.residuals[j], since(sampled, aside.taken))
    else:
        used = found.carried.used[prepared.slots[output], j]
        taken = sampled.taken[used]
        late = _settled_from(taken.size)
        band = band_of(found.predicted[output][j][used][late:], since(sampled, taken, before=True)[late:])
    return None if band is None else band.at(since(sampled, found.grid))


def _settled_from(count: int) -> int:
    """The first of so many samples that is not of the start."""
    return count - settled(np.zeros(count)).size
