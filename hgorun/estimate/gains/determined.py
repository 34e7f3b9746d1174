"""How well recordings determine the gains that were found: standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np

from hgorun.config.tuning import Range
from hgorun.estimate.gains.cases import counted, errors_of
from hgorun.estimate.gains.tuning import LITTLE, Trials
from hgorun.symbolic.evaluate import Floats

_STRETCHES = 10  # of a recording, whose errors may hang together
_NOTHING = 1e-12  # of the largest curvature: none, but for rounding
_PART = 1e-6  # of a direction: that it has no part in it


def standard_errors(trials: Trials) -> dict[str, float]:
    """Those of the gains with the smallest score, each beside all others, by path.

    Errors are taken as linear in the gains near the best ones. Those of a tenth of a recording may hang together, as
    where a model is wrong or an encoder rounds; different tenths are independent.

    Parameters
    ----------
    trials : Trials

    Returns
    -------
    dict of str to float
        Infinite where no error depends on a gain; nothing where an estimate beside the best one is lost, or samples are
        too few for so many gains.
    """
    u = np.array(trials.first)
    found = _stretches(trials, u)
    if found is None or len(found) <= u.size:
        return {}
    slopes = []
    for k in range(u.size):
        step = LITTLE if u[k] + LITTLE <= 1 else -LITTLE
        beside = _stretches(trials, u + step * np.eye(u.size)[k])
        if beside is None or [one.size for one in beside] != [one.size for one in found]:
            return {}
        slopes.append([(there - here) / step for there, here in zip(beside, found, strict=True)])
    parts = [np.column_stack(one) for one in zip(*slopes, strict=True)]
    deviations = np.sqrt(np.diag(spread(parts, found)))
    per_place = [_per_place(one, float(one.at(place))) for one, place in zip(trials.gains.values(), u, strict=True)]
    return dict(zip(trials.gains, (deviations * per_place).tolist(), strict=True))


def spread(slopes: Sequence[Floats], errors: Sequence[Floats]) -> Floats:
    """The covariance of least squares, from what is found where each stretch in turn is left out (the jackknife).

    Parameters
    ----------
    slopes : sequence of ndarray, shape (n, k)
        Of each stretch.
    errors : sequence of ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (k, k)
        Infinite on the diagonal where a direction in which nothing changes has a part.
    """
    squares = [slope.T @ slope for slope in slopes]
    square = np.sum(squares, axis=0)
    lengths = np.sqrt(np.diag(square))
    lengths[lengths == 0] = 1.0
    curvatures, directions = np.linalg.eigh(square / np.outer(lengths, lengths))
    known = curvatures > _NOTHING * curvatures.max()
    inverse = (directions[:, known] / curvatures[known]) @ directions[:, known].T / np.outer(lengths, lengths)
    left = (1 + _NOTHING) * np.eye(lengths.size)  # of all, where a stretch is left out; little, where it decides alone
    shifts = np.array(
        [
            inverse @ np.linalg.solve(left - own @ inverse, slope.T @ error)
            for own, slope, error in zip(squares, slopes, errors, strict=True)
        ]
    )
    around = shifts - shifts.mean(axis=0)
    found = around.T @ around * (len(shifts) - 1) / len(shifts)
    open_ended = np.any(np.abs(directions[:, ~known]) > _PART, axis=1)
    found[open_ended, open_ended] = np.inf
    return np.asarray(found)


def _stretches(trials: Trials, u: Floats) -> list[Floats] | None:
    """The errors that are counted, of each stretch of each recording, with all its outputs; None where one is lost."""
    found, gains = [], trials.at(u)
    masks = iter(trials.left_out or ())
    for case in trials.cases:
        errors = errors_of([case], trials.goal, gains)
        if errors is None:
            return None
        left_out = list(islice(masks, len(errors)))
        of_outputs = [counted([one], left_out[i : i + 1] or None) for i, one in enumerate(errors)]
        cut = [np.array_split(one, _STRETCHES) for one in of_outputs]
        found += [one for one in map(np.concatenate, zip(*cut, strict=True)) if one.size]
    return found


def _per_place(one: Range, value: float) -> float:
    """How much a gain changes for a change of its place in the unit cube."""
    low, high = one.ends
    return value * float(np.log(high / low)) if one.log is not None else high - low
