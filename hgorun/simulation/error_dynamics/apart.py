"""Outputs that are sampled at times of their own: what becomes of small errors, and how limits of it are told."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from hgorun.pieces import distinct
from hgorun.simulation.error_dynamics.monodromy import exponentials
from hgorun.simulation.error_dynamics.timing import below, listed
from hgorun.symbolic.evaluate import Floats

_MOST = 256  # events that are followed
_COMMON = 64  # periods of one output, at most, after which all are sampled as before
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Apart:
    """Samples that are not those of all outputs together, none of them late; they are followed as if they came again.

    Attributes
    ----------
    gaps : ndarray, shape (K,)
        From each event to the next one.
    fresh : ndarray of bool, shape (K, q)
        The outputs that are sampled at each event.
    periods : mapping of str to float
        Of every output the time between its samples, as a rule.
    """

    gaps: Floats
    fresh: np.ndarray
    periods: Mapping[str, float]

    @classmethod
    def of_periods(cls, periods: Mapping[str, float], offsets: Sequence[float]) -> Apart | None:
        """Of outputs that are sampled periodically; None where they are not for too long as they were before."""
        base = min(periods.values())
        parts = [Fraction(one / base).limit_denominator(_COMMON) for one in periods.values()]
        again = math.lcm(*(one.numerator for one in parts)) / math.gcd(*(one.denominator for one in parts))
        exact = all(
            abs(part * base - one) <= _ROUNDING * one for part, one in zip(parts, periods.values(), strict=True)
        )
        if not exact or again > _COMMON:
            return None
        span = again * base
        times = list[Floats]()
        for one, offset in zip(periods.values(), offsets, strict=True):
            times.append(offset % one + one * np.arange(round(span / one), dtype=float))
        return cls._of(times, span, periods, _ROUNDING * base)

    @classmethod
    def of_samples(cls, times: Sequence[Floats], periods: Mapping[str, float]) -> Apart | None:
        """Of recorded samples, by the first of them; None for too few.

        Parameters
        ----------
        times : sequence of ndarray
            When those of every output have been taken, ascending.
        """
        events = distinct(np.sort(np.concatenate(times)))[: _MOST + 1]
        if events.size < 2:
            return None
        last = float(events[-1])
        some = [one[one < last] for one in times]
        return cls._of(some, last - float(events[0]), periods, 0.0)

    @classmethod
    def _of(cls, times: Sequence[Floats], span: float, periods: Mapping[str, float], near: float) -> Apart:
        """Samples at some times, and again after a span; those so near to each other are of one event."""
        every = np.sort(np.concatenate(times))
        events = every[np.append(True, np.diff(every) > near)]
        at = [np.searchsorted(events, one + near, side="right") - 1 for one in times]
        fresh = np.zeros((events.size, len(times)), dtype=bool)
        for i, places in enumerate(at):
            fresh[places, i] = True
        return cls(np.diff(np.append(events, events[0] + span)), fresh, periods)

    @property
    def longest(self) -> float:
        """How old a sample is at most before the next one has come."""
        return max(self.periods.values())

    def scaled(self, part: float) -> Apart:
        """The same with a part of all times."""
        periods = {name: part * period for name, period in self.periods.items()}
        return replace(self, gaps=part * self.gaps, periods=periods)

    def told(self, unit: str) -> str:
        """The times in use."""
        several = {f"{period:.4g}" for period in self.periods.values()}
        if len(several) == 1:
            return f"the period {listed(several, unit)} of outputs that are not sampled together"
        of = " and ".join(f"{listed([f'{period:.4g}'], unit)} of {name}" for name, period in self.periods.items())
        return f"the periods {of}"

    def limits(self, gain: str | None, part: float | None, unit: str) -> str:
        """What would do: a gain, and a part of the times in use."""
        found = [] if gain is None else [gain]
        if part is not None:
            several = list(dict.fromkeys(below(part * period) for period in self.periods.values()))
            what = "a period" if len(several) == 1 else "periods"
            found.append(f"{what} of at most {listed(several, unit)}")
        return ", or ".join(found)

    def factors(self, G: Floats, H: Floats) -> Floats:
        """By how much errors grow from event to event in the mean, at each of P points; infinite where not a number.

        Parameters
        ----------
        G : ndarray, shape (P, N + q, N + q)
            (xi, e)' = G (xi, e) between samples.
        H : ndarray, shape (P, q, N)
            e = H xi at a sample.
        """
        (points, q, N), (gaps, which) = H.shape, np.unique(self.gaps, return_inverse=True)
        with np.errstate(over="ignore", invalid="ignore"):
            flows = [exponentials(G * gap) for gap in gaps]
            state, size = np.broadcast_to(np.eye(N + q), (points, N + q, N + q)), np.zeros(points)
            for gap, fresh in zip(which.ravel(), self.fresh, strict=True):
                sampled = np.where(fresh[:, None], H @ state[:, :N], state[:, N:])
                state = flows[gap] @ np.concatenate([state[:, :N], sampled], axis=1)
                norm = np.max(np.abs(state), axis=(1, 2))
                norm = np.where(norm > 0, norm, 1.0)
                state, size = state / norm[:, None, None], size + np.log(norm)
        known = np.all(np.isfinite(state), axis=(1, 2)) & np.isfinite(size)
        radii = np.full(points, np.inf)
        spectral = np.max(np.abs(np.linalg.eigvals(state[known])), axis=1)
        with np.errstate(divide="ignore"):
            radii[known] = np.exp((np.log(spectral) + size[known]) / len(self.gaps))
        return radii
