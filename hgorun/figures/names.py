"""What can be named in a figure, and the refusal of names that stand for nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hgorun.config.expressions import nearest
from hgorun.config.models import Figure, Panel
from hgorun.errors import Problem
from hgorun.figures.style import LARGEST, LOWEST, NARROWEST
from hgorun.result import Result


@dataclass(frozen=True)
class Names:
    """What the panels of a figure can refer to; known before a simulation.

    Attributes
    ----------
    states, outputs : tuple of str
    observers : tuple of str
        Labels; with several runs ``run/label``, and a label alone means that observer in every run.
    span : (start, end), optional
        The time of the run; without it windows are not checked against it.
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    observers: tuple[str, ...]
    span: tuple[float, float] | None = None


def names_of(results: Sequence[Result]) -> Names:
    """The names of one result, or of several together."""
    labels = [label for r in results for label in r.observers]
    labels += [f"{r.name}/{label}" for r in results for label in r.observers]
    ends = [(float(r.time[0]), float(r.time[-1])) for r in results if r.time.size]
    return Names(
        tuple(dict.fromkeys(name for r in results for name in r.states)),
        tuple(dict.fromkeys(name for r in results for name in r.outputs)),
        tuple(dict.fromkeys(labels)),
        (min(a for a, _ in ends), max(b for _, b in ends)) if ends else None,
    )


def check(
    figures: Mapping[str, Figure],
    states: Sequence[str],
    outputs: Sequence[str],
    observers: Sequence[str],
    span: tuple[float, float] | None = None,
) -> None:
    """Refuse figures that cannot be drawn; needs names only, no simulation.

    Parameters
    ----------
    figures : mapping of str to hgorun.config.models.Figure
    states, outputs : sequence of str
    observers : sequence of str
        Labels that panels may use.
    span : (start, end), optional
        The time of the run; without it windows are not checked against it.

    Raises
    ------
    Problem
        At ("figures", name, "panels", i, key), with the nearest name where one is unknown.
    """
    known = Names(tuple(states), tuple(outputs), tuple(observers), span)
    for name, figure in figures.items():
        path = ("figures", name)
        if not name or name.startswith(".") or any(c in "/\\" or not c.isprintable() for c in name):
            raise Problem(path, "a figure's name is the name of its file: no leading `.`, no / or \\")
        smallest = {"width": NARROWEST, "height": LOWEST[0] + LOWEST[1] * len(figure.panels)}
        for key, inches in (("width", figure.width), ("height", figure.height)):
            if inches is not None and not smallest[key] <= inches <= LARGEST:
                raise Problem((*path, key), f"expected {smallest[key]:g} to {LARGEST:g} inches, found {inches:g}")
        for i, panel in enumerate(figure.panels):
            _check_panel(panel, known, (*path, "panels", i))


def _check_panel(panel: Panel, known: Names, path: tuple[str | int, ...]) -> None:
    for key, kind, found, allowed in (
        ("state", "state", panel.state, known.states),
        ("error", "state", panel.error, known.states),
        ("output", "output", panel.output, known.outputs),
        *(("observers", "observer", label, known.observers) for label in panel.observers or ()),
    ):
        if found is not None and found not in allowed:
            hint = nearest(found, allowed)
            raise Problem((*path, key), f"no {kind} is called {found!r}.{hint} Known: {', '.join(allowed) or 'none'}")
    if panel.output is not None and panel.observers is not None:
        raise Problem(
            (*path, "observers"),
            "an output panel shows measurements and the noise-free output, no observers; "
            "for estimates write state instead of output, with measurements: true",
        )
    if panel.measurements and panel.error is not None:
        raise Problem((*path, "measurements"), "measurements go with state or output, not with error")
    if panel.measurements and panel.state is not None and panel.state not in known.outputs:
        raise Problem(
            (*path, "measurements"),
            f"state {panel.state!r} is not an output, so it has no measurements. "
            f"Outputs: {', '.join(known.outputs) or 'none'}",
        )
    for key, interval in (("window", panel.window), ("limits", panel.limits)):
        if interval is not None and not interval[0] < interval[1]:
            raise Problem((*path, key), f"expected [from, to] with from < to, found [{interval[0]:g}, {interval[1]:g}]")
    if panel.window is not None and known.span is not None:
        start, end = known.span
        if panel.window[1] <= start or panel.window[0] >= end:
            raise Problem(
                (*path, "window"),
                f"the run lasts from {start:g} to {end:g}; "
                f"nothing of it lies in [{panel.window[0]:g}, {panel.window[1]:g}]",
            )
