"""Held-out samples that are so far from the estimates of all observers that a score says little but of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores.evaluated import Evaluated
from hgorun.estimate.scores.outlying import FAR, NORMAL, few
from hgorun.estimate.scores.scores import rms
from hgorun.pieces import median
from hgorun.symbolic.evaluate import Floats


def far_off(prepared: PreparedEstimate, found: Evaluated) -> Iterator[str]:
    """What is told of outliers among the samples that were held out: they count, and make a score twice as large.

    What is far off for all observers from the first sample on is not meant: there the estimates are still on their way.
    """
    noise, origin = stated(prepared.experiment), prepared.run.origin
    for name, one in found.held_out.items():
        sound = np.flatnonzero(np.isfinite(one.residuals).all(axis=1)).tolist()
        if not one.taken.size or not sound:
            continue
        residuals = one.residuals[sound]
        sizes = np.min([_deviations(row, noise.get(name, 0.0)) for row in residuals], axis=0)
        far = few(sizes > FAR)
        count = int(np.count_nonzero(far))
        scores = [(rms(row) or 0.0, rms(row[~far]) or 0.0) for row in residuals]
        if not count or not all(2 * rest < whole for whole, rest in scores):
            continue
        size, at = float(sizes[far].min()), origin + float(one.taken[far.argmax()])
        whose = [f" of {prepared.run.observers[j].label}" if len(scores) > 1 else "" for j in sound]
        without = ", ".join(
            f"holdout_rmse{of} is {rest:.3g} in place of {whole:.3g}"
            for of, (whole, rest) in zip(whose, scores, strict=True)
        )
        if count == 1:
            yield (
                f"{name}: 1 held-out sample is {size:.3g} standard deviations farther from the estimates than usual, "
                f"at t = {at:g}: an outlier, or one was used shortly before; without it {without}"
            )
        else:
            yield (
                f"{name}: {count} held-out samples are {size:.3g} standard deviations or more farther from the "
                f"estimates than usual, the first at t = {at:g}: outliers, or some were used shortly before; "
                f"without them {without}"
            )


def _deviations(residuals: Floats, least: float) -> Floats:
    """How many standard deviations each is from their median; of residuals that are mostly equal, none."""
    away = np.abs(residuals - median(residuals))
    scale = max(NORMAL * median(away), least)
    return away / scale if scale > 0 else np.zeros(away.size)
