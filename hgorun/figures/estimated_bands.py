"""Bands of estimates of recorded data: what should lie in them, and how those that jump at samples are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.actors import Simulated
from hgorun.figures.data import Curve, inside
from hgorun.figures.scene import Scene
from hgorun.figures.style import BAND, BAND_OF_SAMPLES, BAND_OPACITY, edged
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import WIDE
from hgorun.tables.typeset import words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TEETH = 60  # of a band in a panel: of more, tips are joined
_GAP = 3.0  # mean intervals between samples
_FLAT = 1e-9  # of the largest width: smaller differences are roundings


def draw_bands(ax: Axes, scene: Scene, state: str) -> list[np.ndarray]:
    """The band of every estimate that has one, with what it is of for the legend; the edges of those drawn.

    Beside samples that were held out, the band of a Kalman filter has a dotted one about it: that of samples, with
    their noise, whose variance is that of the innovations without that of the estimate.
    """
    edges: list[np.ndarray] = []
    kinds = _kinds(scene)
    names = {what: ", ".join(dict.fromkeys(_name(scene, actor) for actor in who)) for what, who in kinds.items()}
    whose = {what: f" ({text})" if len(kinds) > 1 else "" for what, text in names.items()}
    for what, actors in kinds.items():
        label = BAND + what + whose[what]
        for actor in actors:
            found = _band(actor, state)
            if found is not None:
                edges += _draw(ax, scene, actor, *found)
                ax.plot([], [], color=scene.looks[actor.order].colour, label=label)
    for of_state, of_samples in ((_STATE, _MEASURED), (_STATE + _STEADY, _MEASURED + _STEADY)):
        label = BAND + of_samples + whose.get(of_state, "")
        for actor in kinds.get(of_state, ()):
            for output in actor.result.outputs_of(state):
                found = _of_samples(actor, state, output)
                if found is not None:
                    edges += _draw(ax, scene, actor, *found, dotted=True)
                    ax.plot([], [], color=scene.looks[actor.order].colour, label=label, **BAND_OF_SAMPLES)
    return edges


def _name(scene: Scene, actor: Simulated) -> str:
    """What the legend calls an observer, in whatever run."""
    return scene.looks[actor.order].text.removeprefix(f"{words(actor.run)}: ")


_STATE, _MEASURED = "the true state", "samples"
_STEADY = ", fewer in gaps"  # of bands that do not grow there as the errors do


def _kinds(scene: Scene) -> dict[str, list[Simulated]]:
    """The observers with bands, by what should lie in these."""
    found: dict[str, list[Simulated]] = {}
    for actor in scene.actors:
        assessed = actor.observer.assessed
        if assessed is not None and np.any(np.isfinite(assessed.lower)):
            of_covariance = _of_covariance(actor.observer)
            is_steady = not of_covariance or _is_continuous(actor.observer)
            what = (_STATE if of_covariance else _MEASURED) + (_STEADY if is_steady and _has_gaps(actor) else "")
            found.setdefault(what, []).append(actor)
    return found


def _has_gaps(actor: Simulated) -> bool:
    """Whether samples of an output, as far as the observer used them, are missing for long, also at the end."""
    recorded, end = actor.result.recorded, actor.result.time[-1]
    k = list(actor.result.observers).index(actor.label)
    for one in () if recorded is None else recorded.outputs.values():
        steps = np.diff(np.append(np.sort(one.available[one.used[:, k]]), end))
        if steps.size > 1 and steps.max() > _GAP * steps[:-1].mean():
            return True
    return False


def _is_continuous(observer: ObserverResult) -> bool:
    """Whether its covariance shrinks as if outputs were measured all the time, by an R of the mean interval."""
    from hgorun.observers.base import OBSERVERS  # long to import
    from hgorun.observers.kalman import KalmanFilter

    try:
        kind = OBSERVERS.find(observer.type)
    except KeyError:  # of a package that is not installed here
        return False
    return isinstance(kind, type) and issubclass(kind, KalmanFilter) and not kind.of_samples


def _of_covariance(observer: ObserverResult) -> bool:
    """Whether the band of an estimate is that of its covariance P, and not one of residuals."""
    assessed, P = observer.assessed, observer.internal.get("P")
    if assessed is None or P is None or P.shape != (*observer.xhat.shape, observer.xhat.shape[1]):
        return False
    half = (assessed.upper - assessed.lower) / 2
    deviation = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    known = np.isfinite(half) & np.isfinite(deviation)
    return bool(known.any() and np.allclose(half[known], WIDE * deviation[known], rtol=1e-4, atol=1e-12))


def _band(actor: Simulated, state: str) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Times and both edges; None without a band of this state."""
    assessed, result = actor.observer.assessed, actor.result
    if assessed is None or state not in result.states:
        return None
    k = result.states.index(state)
    lower, upper = assessed.lower[:, k], assessed.upper[:, k]
    return (result.time, lower, upper) if np.any(np.isfinite(lower)) else None


def _of_samples(actor: Simulated, state: str, output: str) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The band of samples about the estimate; None where none was held out, or the noise is not known.

    Beside the variance of the estimate, which is known at all times, it has that of the noise: what the variance of
    innovations has more than the estimate had just before.
    """
    result, recorded, of_state = actor.result, actor.result.recorded, _band(actor, state)
    if recorded is None or output not in recorded.held_out or of_state is None:
        return None
    one, k = recorded.outputs[output], list(result.observers).index(actor.label)
    innovation, nis = one.innovation[:, k], one.nis[:, k]
    known = np.flatnonzero((nis > 0) & np.isfinite(nis))
    t, lower, upper = of_state
    half = (upper - lower) / 2
    before = half[np.maximum(np.searchsorted(t, one.taken[known]) - 1, 0)]
    noise = (WIDE * innovation[known]) ** 2 / nis[known] - before**2
    noise = noise[np.isfinite(noise)]
    if not noise.size:
        return None
    half = np.sqrt(half**2 + max(float(np.median(noise)), 0.0))
    middle = (lower + upper) / 2
    return t, middle - half, middle + half


def _draw(
    ax: Axes,
    scene: Scene,
    actor: Simulated,
    t: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    dotted: bool = False,
) -> list[np.ndarray]:
    """A band, with its hairs joined; its edges in the window of the scene."""
    start, end = scene.window or (actor.result.time[0], actor.result.time[-1])
    half = without_hairs(t, upper - lower, (end - start) / _TEETH) / 2
    middle = (lower + upper) / 2
    lower, upper = middle - half, middle + half
    how = edged(scene.looks[actor.order].colour, 0.0 if dotted else BAND_OPACITY)
    how |= BAND_OF_SAMPLES if dotted else {}
    ax.fill_between(t, lower, upper, **how, zorder=1.3 if dotted else 1.2)
    shown = [inside(Curve(t, edge), scene.window).v for edge in (lower, upper)]
    return [edge[np.isfinite(edge)] for edge in shown]


def without_hairs(t: np.ndarray, width: np.ndarray, narrowest: float) -> np.ndarray:
    """The width of a band, with tips joined that are closer to each other than a time.

    Of a band that is drawn with its edges, tips so close are a comb of hairs that hides all else. Where they are
    farther apart nothing changes: it is seen how the band grows from sample to sample.

    Parameters
    ----------
    t, width : ndarray, shape (Nt,)
        The width is NaN where there is no band, and stays so.
    narrowest : float
        In units of t.
    """
    found = width.copy()
    known = np.flatnonzero(np.isfinite(width))
    for piece in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        found[piece] = _joined(t[piece], width[piece], narrowest)
    return found


def _joined(t: np.ndarray, width: np.ndarray, narrowest: float) -> np.ndarray:
    """Again and again, with fewer tips each time: among those of small teeth there are those of larger ones."""
    while True:
        first, last = _tips(width)
        close = np.flatnonzero(t[first[1:]] - t[last[:-1]] < narrowest)
        begins = np.zeros(width.size, dtype=int)
        begins[last[close] + 1] += 1
        begins[first[close + 1]] -= 1
        between = np.cumsum(begins) > 0
        if not between.any():
            return width
        knots = np.unique([first, last])
        width = np.where(between, np.maximum(width, np.interp(t, t[knots], width[knots])), width)


def _tips(width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first and the last place of every highest stretch between lower ones."""
    slope = np.diff(width)
    rising = np.where(np.abs(slope) > _FLAT * np.max(np.abs(width), initial=0.0), np.sign(slope), 0.0)
    steps = np.flatnonzero(rising)
    tops = np.flatnonzero((rising[steps[:-1]] > 0) & (rising[steps[1:]] < 0))
    return steps[tops] + 1, steps[tops + 1]
