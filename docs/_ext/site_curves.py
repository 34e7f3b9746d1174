"""Curves as small drawings inside a page: lines in the colour of its text, so that they are right on dark pages too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

WIDTH, HEIGHT = 640, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 12, 26, 34
_STYLES = (
    'stroke="currentColor" stroke-width="1.4" stroke-dasharray="6 4"',
    'stroke="var(--color-brand-primary, #0a4bff)" stroke-width="1.8"',
    'stroke="#c2571a" stroke-width="1.8"',
    'stroke="#2e8b57" stroke-width="1.8"',
)
_POINTS = 320  # of a curve: more than a pixel each would not be seen


def drawing(time: np.ndarray, curves: Mapping[str, np.ndarray], *, x: str, y: str, told: str) -> str:
    """An SVG of curves over time.

    Parameters
    ----------
    time : ndarray, shape (Nt,)
    curves : mapping of str to ndarray, shape (Nt,)
        By their names in the legend. The first one, the truth, is dashed.
    x, y : str
        What the axes show.
    told : str
        The drawing in words, for those who cannot see it.
    """
    values = np.concatenate([c[np.isfinite(c)] for c in curves.values()])
    low, high = _span(values)
    across = (float(time[0]), float(time[-1]))
    parts = [
        f'<svg class="curves" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(told)}" '
        'xmlns="http://www.w3.org/2000/svg" font-size="12" fill="currentColor">'
    ]
    frame = 'fill="none" stroke="currentColor" stroke-opacity="0.4"'
    parts.append(
        f'<rect x="{_LEFT}" y="{_TOP}" width="{WIDTH - _LEFT - _RIGHT}" height="{HEIGHT - _TOP - _BOTTOM}" {frame}/>'
    )
    for tick in ticks(*across):
        parts.append(f'<text x="{_x(tick, across):.1f}" y="{HEIGHT - 20}" text-anchor="middle">{tick:g}</text>')
    for tick in ticks(low, high):
        parts.append(
            f'<text x="{_LEFT - 6}" y="{_y(tick, (low, high)) + 4:.1f}" text-anchor="end">{_number(tick)}</text>'
        )
    parts.append(f'<text x="{(WIDTH + _LEFT) / 2:.0f}" y="{HEIGHT - 5}" text-anchor="middle">{escape(x)}</text>')
    parts.append(f'<text x="6" y="{_TOP - 10}">{escape(y)}</text>')
    at = WIDTH - _RIGHT
    for (name, curve), style in reversed(list(zip(curves.items(), _STYLES, strict=False))):
        parts.append(f'<path d="{_path(time, curve, across, (low, high))}" fill="none" {style}/>')
        parts.append(f'<text x="{at}" y="{_TOP - 10}" text-anchor="end">{escape(name)}</text>')
        at -= 7 * len(name) + 8
        parts.append(f'<line x1="{at - 22}" x2="{at}" y1="{_TOP - 14}" y2="{_TOP - 14}" {style}/>')
        at -= 40
    return "\n".join([*parts, "</svg>"])


def ticks(low: float, high: float) -> list[float]:
    """Some round numbers in an interval."""
    width = (high - low) / 4
    unit = 10.0 ** np.floor(np.log10(width))
    step = next(s for s in (unit, 2 * unit, 5 * unit, 10 * unit) if s >= width * 0.999)
    first = np.ceil(low / step)
    return [float(k * step) for k in np.arange(first, np.floor(high / step * (1 + 1e-12)) + 1)]


def _number(value: float) -> str:
    return f"{value or 0.0:.6g}".replace("-", "\N{MINUS SIGN}")


def _span(values: np.ndarray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    edge = 0.05 * (high - low) or 1.0
    return low - edge, high + edge


def _x(t: float, across: tuple[float, float]) -> float:
    return _LEFT + (t - across[0]) / (across[1] - across[0]) * (WIDTH - _LEFT - _RIGHT)


def _y(v: float, up: tuple[float, float]) -> float:
    return HEIGHT - _BOTTOM - (v - up[0]) / (up[1] - up[0]) * (HEIGHT - _TOP - _BOTTOM)


def _path(time: np.ndarray, curve: np.ndarray, across: tuple[float, float], up: tuple[float, float]) -> str:
    kept = _extremes(curve)
    points = [f"{_x(time[i], across):.1f},{_y(curve[i], up):.1f}" for i in kept if np.isfinite(curve[i])]
    return "M" + " ".join(points)


def _extremes(curve: np.ndarray) -> Sequence[int]:
    """Of every few points the lowest and the highest one, so that no peak is lost."""
    if len(curve) <= _POINTS:
        return range(len(curve))
    found: set[int] = {0, len(curve) - 1}
    for part in np.array_split(np.arange(len(curve)), _POINTS // 2):
        inside = np.nan_to_num(curve[part])
        found |= {int(part[inside.argmin()]), int(part[inside.argmax()])}
    return sorted(found)
