"""What can be named in a figure, and the refusal of names that stand for nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hgorun.config.expressions import nearest
from hgorun.config.nearest import listed
from hgorun.config.study import Figure, Inset, Panel
from hgorun.errors import KeyPath, Problem
from hgorun.figures.style import LARGEST, LARGEST_AREA, LARGEST_NUMBER, LOWEST, NARROWEST, PANEL
from hgorun.result.records.data import ResultData
from hgorun.result.run_names import run_names

if TYPE_CHECKING:
    from hgorun.figures.followed import MembersData
    from hgorun.figures.scaling import ScalingData


@dataclass(frozen=True, eq=False, repr=False)
class RunNames:
    """What the panels of a figure can refer to in one run; known before a simulation.

    Attributes
    ----------
    states, outputs : tuple of str
    observers : tuple of str
        Labels.
    span : (start, end), optional
        The time of the run; without it windows are not checked against it.
    measured : tuple of str, optional
        The states that outputs measure; by default those that are called like an output.
    ensemble : str
        What members of an ensemble differ in: ``seeds``, ``vary``, ``seeds and vary``; nothing for a single run.
    one_grid : bool
        Whether all members have the same output grid.
    inputs : tuple of str
        In a closed loop the plant's inputs; else nothing.
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    observers: tuple[str, ...]
    span: tuple[float, float] | None = None
    ensemble: str = ""
    measured: tuple[str, ...] | None = None
    one_grid: bool = True
    inputs: tuple[str, ...] = ()


# By the name of the run. A file without ``runs`` has one, called by its stem.
Names = Mapping[str, RunNames]


def names_of(
    results: Sequence[ResultData], scalings: Iterable[ScalingData] = (), members: Iterable[MembersData] = ()
) -> dict[str, RunNames]:
    """The names of finished runs."""
    found = {}
    for run, r in zip(run_names(results), results, strict=True):
        span = (float(r.time[0]), float(r.time[-1])) if r.time.size else None
        found[run] = RunNames(
            r.states,
            r.outputs,
            tuple(r.observers),
            span,
            measured=tuple(s for s in r.states if r.outputs_of(s)),
            inputs=r.inputs if r.closed_loop else (),
        )
    for s in scalings:
        known = found.get(s.run, RunNames((), (), ()))
        states, observers = dict.fromkeys((*known.states, s.state)), dict.fromkeys((*known.observers, *s.observers))
        found[s.run] = replace(known, states=tuple(states), observers=tuple(observers), ensemble="vary")
    for m in members:
        known = found.get(m.run, RunNames((), (), ()))
        own = replace(known, states=m.members.states, observers=m.members.observers, span=m.span, ensemble=m.kind)
        found[m.run] = own
    return found


def check(figures: Mapping[str, Figure], names: Names) -> None:
    """Refuse figures that cannot be drawn; needs names only, no simulation.

    Parameters
    ----------
    figures : mapping of str to hgorun.config.models.Figure
    names : mapping of str to RunNames
        The runs that the figures can show.

    Raises
    ------
    Problem
        At ("figures", name, "panels", i, key), with the nearest name where one is unknown.
    """
    for name, figure in figures.items():
        path = ("figures", name)
        if not name or name.startswith(".") or any(c in "/\\" or not c.isprintable() for c in name):
            raise Problem(path, "a figure's name is the name of its file: no leading `.`, no / or \\")
        rows = -(-len(figure.panels) // figure.columns)
        smallest = {"width": NARROWEST * figure.columns, "height": LOWEST[0] + LOWEST[1] * rows}
        for key, inches in (("width", figure.width), ("height", figure.height)):
            if inches is not None and not smallest[key] <= inches <= LARGEST:
                raise Problem((*path, key), f"expected {smallest[key]:g} to {LARGEST:g} inches, found {inches:g}")
        height = figure.height or PANEL * rows
        if figure.width * height > LARGEST_AREA:
            raise Problem(
                path,
                f"{figure.width:g} x {height:g} inches are more than {LARGEST_AREA:g} square inches",
            )
        for i, panel in enumerate(figure.panels):
            _check_panel(panel, names, (*path, "panels", i))
        for label in figure.labels:
            _require_observer(label, names, (*path, "labels", label))


def varied_run(panel: Panel, names: Names) -> str | None:
    """The run that a scaling panel shows: the one it names, or the only one with ``vary``."""
    varied = [run for run, n in names.items() if "vary" in n.ensemble]
    named = panel.scaling.run if panel.scaling else None
    return named or (varied[0] if len(varied) == 1 else None)


def _check_panel(panel: Panel, names: Names, path: KeyPath) -> None:
    shown = _scaling_run(panel, names, path) if panel.scaling is not None else _shown_runs(panel, names, path)
    where = f" in run {next(iter(shown))!r}" if len(shown) == 1 < len(names) else ""
    for label in panel.observers or ():
        _require_observer(label, shown, (*path, "observers"), where)
    picked = {
        run: n
        for run, n in shown.items()
        if not panel.observers or any(o in panel.observers for label in n.observers for o in (label, f"{run}/{label}"))
    }
    states = _together(n.states for n in picked.values())
    outputs = _together(n.outputs for n in picked.values())
    for key in ("state", "error", "magnitude"):
        _require(getattr(panel, key), "state", states, (*path, key), where)
    _require(panel.output, "output", outputs, (*path, "output"), where)
    _check_closed(panel, picked, states, path)
    if panel.observers == () and panel.run is None:
        raise Problem((*path, "observers"), "an empty list shows only the truth of a run: name the run with run")
    if panel.scaling is not None:
        _require(panel.scaling.state, "state", states, (*path, "scaling", "state"), where)
        from hgorun.figures.scaling import quantities  # it draws them, too: not for runs without such a panel

        _require(panel.scaling.of, "quantity", list(quantities()), (*path, "scaling", "of"))
    measured = _together(n.outputs if n.measured is None else n.measured for n in picked.values())
    _check_fit(panel, measured, path)
    _check_ranges(panel, [n.span for n in picked.values() if n.span is not None], path)


def _check_closed(panel: Panel, shown: Names, states: Sequence[str], path: KeyPath) -> None:
    """Panels of closed loops."""
    for key, name in (("driven", panel.driven), ("input", panel.input)):
        if name is None:
            continue
        for run, n in shown.items():
            if not n.inputs:
                raise Problem((*path, key), f"run {run!r} has no controller, and no plants that observers drive")
            if n.ensemble:
                raise Problem((*path, key), f"of the members of {run!r} no trajectories are kept")
    _require(panel.driven, "state", states, (*path, "driven"))
    _require(panel.input, "input", _together(n.inputs for n in shown.values()), (*path, "input"))


def _scaling_run(panel: Panel, names: Names, path: KeyPath) -> Names:
    """The run of a scaling panel."""
    assert panel.scaling is not None
    varied = [run for run, n in names.items() if "vary" in n.ensemble]
    key = (*path, "scaling", "run")
    if panel.members is not None:
        raise Problem((*path, "members"), "a scaling panel shows median and bars of members")
    if panel.run is not None:
        raise Problem((*path, "run"), "a scaling panel names its run inside scaling: {state: ..., run: ...}")
    if panel.scaling.run is not None:
        _require(panel.scaling.run, "run", list(names), key)
    if not varied:
        raise Problem(key if panel.scaling.run else (*path, "scaling"), "no run has vary, which scaling needs")
    run = varied_run(panel, names)
    if run is None:
        raise Problem((*path, "scaling"), f"several runs have vary: {', '.join(varied)}; say which with run")
    if run not in varied:
        raise Problem(key, f"run {run!r} has no vary, which scaling needs. Runs with vary: {', '.join(varied)}")
    return {run: names[run]}


def _shown_runs(panel: Panel, names: Names, path: KeyPath) -> Names:
    """The runs whose trajectories a panel may show: all single ones, or the one that it names."""
    single = {run: n for run, n in names.items() if not n.ensemble}
    if panel.run is None:
        if panel.members is not None:
            raise Problem((*path, "members"), "members are those of an ensemble: name it with run")
        return single
    _require(panel.run, "run", list(names), (*path, "run"))
    run = names[panel.run]
    if run.ensemble and not run.one_grid:
        raise Problem((*path, "run"), f"run {panel.run!r} varies time, so that its members have no common grid")
    if run.ensemble and panel.output is not None:
        raise Problem((*path, "output"), f"of ensembles such as {panel.run!r} states are kept, no outputs")
    for key in ("inset", "measurements"):
        if run.ensemble and getattr(panel, key):
            raise Problem((*path, key), f"a panel of an ensemble such as {panel.run!r} has no {key}")
    if panel.members is not None and not run.ensemble:
        raise Problem((*path, "members"), f"run {panel.run!r} is a single run, without members")
    return {panel.run: run}


def _check_fit(panel: Panel, measured: Sequence[str], path: KeyPath) -> None:
    """Keys that do not go with the panel's subject.

    Parameters
    ----------
    measured : sequence of str
        The states that outputs measure.
    """
    if panel.output is not None and panel.observers is not None:
        raise Problem(
            (*path, "observers"),
            "an output panel shows measurements and the noise-free output, no observers; "
            "for estimates write state instead of output, with measurements: true",
        )
    if panel.measurements and panel.subject not in ("state", "output"):
        raise Problem((*path, "measurements"), f"measurements go with state or output, not with {panel.subject}")
    if panel.measurements and panel.state is not None and panel.state not in measured:
        raise Problem(
            (*path, "measurements"),
            f"no output is the state {panel.state!r}, so it has no measurements. "
            f"Measured states: {', '.join(measured) or 'none'}",
        )
    for key in ("window", "inset"):
        if panel.scaling is not None and getattr(panel, key) is not None:
            raise Problem((*path, key), f"{key} is an interval of time, which a scaling panel does not have")


def _check_ranges(panel: Panel, spans: Sequence[tuple[float, float]], path: KeyPath) -> None:
    logarithmic = panel.magnitude is not None or (panel.scaling is not None and panel.scaling.axes == "log")
    span = (min(a for a, _ in spans), max(b for _, b in spans)) if spans else None
    _check_range(panel.limits, (*path, "limits"), positive=logarithmic)
    _check_range(panel.window, (*path, "window"))
    _check_overlap(panel.window, span, "the run lasts", (*path, "window"))
    if panel.inset is not None:
        inside = (*path, "inset")
        _check_range(panel.inset.limits, (*inside, "limits"), positive=logarithmic)
        _check_range(panel.inset.window, (*inside, "window"))
        _check_overlap(panel.inset.window, span, "the run lasts", (*inside, "window"))
        _check_overlap(panel.inset.window, panel.window, "the panel shows", (*inside, "window"))
        _check_place(panel.inset, (*inside, "place"))


def _check_range(interval: tuple[float, float] | None, path: KeyPath, *, positive: bool = False) -> None:
    if interval is not None and not interval[0] < interval[1]:
        raise Problem(path, f"expected [from, to] with from < to, found [{interval[0]:g}, {interval[1]:g}]")
    if interval is not None and max(map(abs, interval)) > LARGEST_NUMBER:
        raise Problem(path, f"expected numbers up to {LARGEST_NUMBER:g}, found [{interval[0]:g}, {interval[1]:g}]")
    if interval is not None and positive and not interval[0] > 0:
        raise Problem(path, f"a logarithmic axis needs numbers > 0, found [{interval[0]:g}, {interval[1]:g}]")


def _check_overlap(
    window: tuple[float, float] | None, span: tuple[float, float] | None, what: str, path: KeyPath
) -> None:
    if window is not None and span is not None and (window[1] <= span[0] or window[0] >= span[1]):
        raise Problem(
            path,
            f"{what} from {span[0]:g} to {span[1]:g}; nothing of it lies in [{window[0]:g}, {window[1]:g}]",
        )


def _check_place(inset: Inset, path: KeyPath) -> None:
    if inset.place is None:
        return
    left, bottom, width, height = inset.place
    within = min(left, bottom) >= 0 and max(left + width, bottom + height) <= 1 + 1e-9
    if not (within and min(width, height) >= 0.1):
        raise Problem(
            path,
            "expected [left, bottom, width, height] as fractions of the panel: inside it, at least 0.1 wide and high; "
            f"found [{', '.join(f'{part:g}' for part in inset.place)}]",
        )


def _require(found: str | None, kind: str, allowed: Sequence[str], path: KeyPath, where: str = "") -> None:
    if found is not None and found not in allowed:
        hint = nearest(found, allowed)
        known = listed(allowed, found)
        raise Problem(path, f"no {kind}{where} is called {found!r}.{hint} Known: {known}")


def _require_observer(found: str, names: Names, path: KeyPath, where: str = "") -> None:
    """A label, which means that observer in every run, or ``run/label``."""
    labels = _together(n.observers for n in names.values())
    with_run = [f"{run}/{label}" for run, n in names.items() for label in n.observers]
    if found not in with_run:
        _require(found, "observer", labels + (with_run if len(names) > 1 else []), path, where)


def _together(groups: Iterable[Iterable[str]]) -> list[str]:
    return list(dict.fromkeys(name for group in groups for name in group))
