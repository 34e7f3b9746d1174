"""Weighted sums of slopes, as native code: what every method of Runge and Kutta's kind steps with."""

from __future__ import annotations

from hgorun.native.ir import Function


def weighted(f: Function, weights: tuple[float, ...], slopes: list[str], place: str | int) -> str:
    """sum_j weights[j] slopes[j] of one state; weights of one cost no multiplication."""
    total = ""
    for weight, slope in zip(weights, slopes, strict=False):
        if weight != 0.0:
            term = f.load(f.at(slope, place), f.real)
            if not total:
                total = term if weight == 1.0 else f.mul(f.constant(weight), term)
            else:
                total = f.add(total, term) if weight == 1.0 else f.fma(f.constant(weight), term, total)
    return total


def advanced(f: Function, factor: str, weights: tuple[float, ...], slopes: list[str], z: str, place: int) -> str:
    """z + factor sum_j weights[j] slopes[j] of one state."""
    return f.fma(factor, weighted(f, weights, slopes, place), f.load(f.at(z, place), f.real))
