"""Outliers among the first samples: those that no start explains which explains the others."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np

from hgorun.estimate.start.fit import TOLD, Fit, fit
from hgorun.estimate.start.start_task import StartTask
from hgorun.pieces import median
from hgorun.symbolic.evaluate import Floats

_REWEIGHTED = 30  # passes in which errors of a start count by their size
_SETS, _FITTED, _LINEAR = 2000, 6, 4  # of outliers that are looked at; that are tried; times that each is
_BEYOND = 2.0  # gates that several outliers are off, in standard deviations of the others
_MOST = 3  # of so many samples of a slow output one may be an outlier
_NORMAL = 1.4826  # standard deviations of normal numbers in their median size


def judged(near: StartTask, many: StartTask, far: StartTask, x: Floats) -> Fit | None:
    """The fit to first samples of fast and slow outputs, without outliers.

    First those in the time of the fastest output are judged alone, since over the time of ten samples of a slow one
    what the model lacks may count more than the noise. Then those of slow outputs are judged beside these: the farthest
    is left out until all others are within their gates. That counts only where those left out are few, and farther off
    than the others are from the model; otherwise no start explains so long a time.

    Parameters
    ----------
    near, many, far : StartTask
        Of the samples in the time of the fastest output, of those in the time of twice as many, and of as many of each
        output as the first.
    x : ndarray
        A guess.
    """
    found = without_outliers(near, x)
    if not agree(near, found) and (other := of_many(near, many, x)) is not None:
        return other
    more = [of_far.size > of_near.size for of_near, of_far in zip(near.numbers, far.numbers, strict=True)]
    if found is None or not any(more):
        return found
    kept = np.concatenate([~np.isin(one, left) for one, left in zip(far.numbers, found.left, strict=True)])
    output = np.repeat(np.arange(len(more)), [one.size for one in far.numbers])
    may, sizes = [one.size // _MOST for one in far.numbers], list[float]()
    at = fit(replace(far, weights=kept.astype(float)), found.x)
    while at is not None:
        error, _ = at.task.residuals(at.x)
        beyond = np.where(kept, at.own_deviations(error) / far.gates, 0.0)
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 1:
            known = kept & np.isfinite(far.gates)
            told = bool(sizes) and min(sizes) > _spread(error[known], x.size)
            return replace(at, left=far.chosen(~kept)) if told else found
        kept[worst] = False
        sizes.append(float(beyond[worst]))
        i = int(output[worst])
        if not more[i] or np.count_nonzero(~kept[output == i]) > may[i]:
            return found
        at = fit(replace(at.task, weights=kept.astype(float)), at.x)
    return found


def of_many(near: StartTask, many: StartTask, x: Floats) -> Fit | None:
    """The fit to twice as many samples, if these agree and more of the first are outliers than the first can tell."""
    if near.gates.size == many.gates.size:
        return None
    other = without_outliers(many, x)
    if other is None or not _others_agree(many, other):
        return None
    out = sum(np.count_nonzero(np.isin(own, left)) for own, left in zip(near.numbers, other.left, strict=True))
    return other if out > _most_of(near.gates.size, x.size) else None


def agree(task: StartTask, found: Fit | None) -> bool:
    """Whether there is a fit that leaves no samples out, of which all are within their gates."""
    return found is not None and not any(left.size for left in found.left) and _others_agree(task, found)


def _others_agree(task: StartTask, found: Fit) -> bool:
    """Whether all samples are within their gates of a fit, but for those that it has left out."""
    error, _ = found.task.residuals(found.x)
    kept = ~np.concatenate([np.isin(own, out) for own, out in zip(task.numbers, found.left, strict=True)])
    return found.within_gates(error, kept)


def _most_of(size: int, n: int) -> int:
    """How many of some samples may be outliers, of a model with n states: more than half, and n + 2, have to agree."""
    return size - max(n + 2, size // 2 + 1)


def _spread(error: Floats, states: int) -> float:
    """The standard deviation of the errors of a fit."""
    return float(np.sqrt(error @ error / max(error.size - states, 1)))


def without_outliers(task: StartTask, x: Floats) -> Fit | None:
    """The fit to all samples, or where gates leave some out, that to the others.

    If all are within the gates of the fit to all, that is the one; errors count in their own standard deviations, which
    are smaller at the ends of the samples, where a fit follows each of them more. Otherwise the farthest is left out.
    If the others are not within their gates even then, those few are sought without which they are, and which are far
    beyond theirs then. If there are none, what is far off counts by its size and no longer by its square, which few
    outliers turn little; those that are beyond the gates of that fit are left out. Two more samples than states are
    needed to tell which of them it is, and more than half have to agree. If all are within the gates of a fit that
    begins at the one that was found, none is an outlier.
    """
    found = fit(task, x)
    if found is None or len(task.gates) < x.size + 2:
        return found
    best = _without(found)
    if any(left.size for left in best.left):  # the fit to all may have been one that is nearest only beside it
        whole = fit(replace(best.task, weights=1.0), best.x)
        if whole is not None and whole.within_gates(whole.task.residuals(whole.x)[0], np.ones(len(task.gates), bool)):
            return whole
    return best


def _without(found: Fit) -> Fit:
    """The same beside one fit to all."""
    task, n = found.task, found.x.size
    error, _ = task.residuals(found.x)
    beyond = found.own_deviations(error) / task.gates
    if not np.any(beyond > 1):
        return found
    kept = np.arange(error.size) != np.argmax(beyond)
    others = fit(replace(task, weights=kept.astype(float)), found.x)
    if others is not None:
        rest, _ = others.task.residuals(others.x)
        if others.within_gates(rest, kept) and np.max(beyond) > _spread(rest[kept & np.isfinite(task.gates)], n):
            return replace(others, left=task.chosen(~kept))
    if (several := _without_several(task, found)) is not None:
        return several
    bent = found
    for _ in range(_REWEIGHTED):
        weights = 1 / np.sqrt(np.maximum(np.abs(error), 1.0))
        bent = fit(replace(bent.task, weights=weights), bent.x) or bent
        error, _ = bent.task.residuals(bent.x)
    free = np.sort(np.abs(error))[n:]  # those that it need not pass through
    kept = np.abs(error) <= task.gates * max(1.0, _NORMAL * median(free))
    if kept.all() or 2 * np.count_nonzero(kept) <= kept.size:
        return found
    others = fit(replace(bent.task, weights=kept.astype(float)), bent.x)
    return found if others is None else replace(others, left=task.chosen(~kept))


def _without_several(task: StartTask, base: Fit) -> Fit | None:
    """The fit without the fewest samples, two or more, that has all others within their gates and these far beyond.

    What a model lacks grows from sample to sample: then the nearest of those that are left out is not far beyond, as
    the errors of the others are large. A start without two good samples costs little; one through outliers costs all.
    """
    size, n = task.gates.size, base.x.size
    for count in range(2, _most_of(size, n) + 1):
        if math.comb(size, count) > _SETS:
            return None
        sets = np.array(list(combinations(range(size), count)))
        likely = np.argsort(_left_without(*base.task.residuals(base.x), sets), kind="stable")
        for which in sets[likely[:_FITTED]]:  # slopes at a fit to outliers may say little
            found, kept = _beside(base, which, sets)
            error, _ = found.task.residuals(found.x)
            limit = _BEYOND * max(1.0, _spread(error[kept & np.isfinite(task.gates)], n))
            if found.within_gates(error, kept) and np.all(np.abs(error[~kept]) > limit * task.gates[~kept]):
                return replace(found, left=task.chosen(~kept))
    return None


def _beside(base: Fit, which: np.ndarray, sets: np.ndarray) -> tuple[Fit, np.ndarray]:
    """A fit without a set of samples, or without that which it tells itself; and which ones are kept."""
    found, kept = base, np.ones(base.task.gates.size, dtype=bool)
    for _ in range(_LINEAR):  # the samples tell which by the slope at a fit, which the fit without them changes
        before, kept = kept, np.ones(kept.size, dtype=bool)
        kept[which] = False
        if np.array_equal(kept, before):
            break
        found = fit(replace(found.task, weights=kept.astype(float)), found.x) or found
        which = sets[np.argmin(_left_without(*found.task.residuals(found.x), sets))]
    return found, kept


def _left_without(error: Floats, slope: Floats, sets: np.ndarray) -> Floats:
    """How large errors are without each set of samples, squared, of a start that moves them by slopes."""
    weights = np.ones((len(sets), error.size))
    np.put_along_axis(weights, sets, 0.0, axis=1)
    scaled = slope / np.maximum(np.linalg.norm(slope, axis=0), np.finfo(float).tiny)
    normal = np.einsum("mi,ij,ik->mjk", weights, scaled, scaled)
    moved = np.einsum("mjk,mk->mj", np.linalg.pinv(normal, rcond=TOLD, hermitian=True), (weights * error) @ scaled)
    return np.asarray(np.sum(weights * (error - moved @ scaled.T) ** 2, axis=1))
