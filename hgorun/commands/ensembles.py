"""``compare`` for ensembles, and ``report``: statistics over their members, figures and a page of them."""

from __future__ import annotations

import json as json_text
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from hgorun.commands.continued import counted
from hgorun.commands.drawn import tell_drawn
from hgorun.commands.ensemble_options import FORMATS, Compare, OfEnsembles, Report
from hgorun.commands.inputs import refuse_name_of_another_thing
from hgorun.commands.outputs import (
    DRAWING_SUFFIXES,
    NOT_OK,
    RESULTS,
    formats,
    refuse_other_kinds,
    there,
    written,
)
from hgorun.commands.remarks import coarse_members
from hgorun.commands.run_options import Simulate
from hgorun.config.expressions import nearest
from hgorun.config.nearest import refuse_other
from hgorun.ensemble.collected.collected import Collected, levels
from hgorun.ensemble.collected.outcome import largest_of_ok, outcome_of
from hgorun.ensemble.collected.reading import is_sweep
from hgorun.ensemble.growing import read_sweep
from hgorun.ensemble.members.refused import refusal_of, told_where
from hgorun.ensemble.sweep import Place
from hgorun.errors import ConfigError, SimulationError
from hgorun.figures.page import Page
from hgorun.originals import note_originals
from hgorun.process import say
from hgorun.progress import shown as progress
from hgorun.study.ensembles import carried_out, ensemble_of
from hgorun.study.study import Run
from hgorun.tables import ensemble as tables
from hgorun.tables import ensemble_data as plain_tables
from hgorun.tables.ensemble import Compared, compared
from hgorun.tables.ensemble_latex import latex

_MOST_POINTS = 40  # that a table has without being asked for
_TOGETHER = "none"
_PAGES = {".html", ".htm"}

Style = Callable[[Sequence[Compared]], str]


def compare_ensembles(options: Compare) -> int:
    """Show statistics of ensembles.

    Raises
    ------
    ConfigError
        For options that do not fit, axes, values and metrics that do not exist, and files that cannot be read.
    """
    refuse_other_kinds(options.output, DRAWING_SUFFIXES, default=RESULTS if options.plots else None)
    style = _style(options)
    Page.named(options.width, options.style)  # refused before anything is computed
    found = [_compared(read_sweep(path), options, str(path)) for path in options.sources]
    for one in found:
        _tell_coarse(one.members)
    if options.json:
        objects = [plain_tables.as_json(one) for one in found]
        print(json_text.dumps(objects[0] if len(objects) == 1 else objects, indent=2, allow_nan=False))
    elif not options.quiet:
        print(style(found))
    if options.plots:
        before = there([] if options.output is None else [options.output])
        drawn = [path for one in found for path in draw(one, options)]
        tell_drawn(drawn, before, options)
        for one in found:
            _tell_nothing_to_draw(one.members)
    return NOT_OK if options.strict and not all(one.members.all_ok for one in found) else 0


def simulate_ensemble(run: Run, target: Path, options: Simulate) -> tuple[dict[str, Any], bool]:
    """Carry out the ensemble of a study's run, and show its statistics.

    What is there already of the same ensemble is kept; members of another configuration are replaced.

    Parameters
    ----------
    target : Path
        The collected file.

    Returns
    -------
    (dict, bool)
        The statistics as JSON holds them, and whether every observer is ok in every member.
    """
    ensemble, place = ensemble_of(run), Place.of(target)
    before = there([place.file])
    with (
        progress(ensemble.size, run.name, "members", show=options.text) as bar,
        counted(ensemble.size, run.name, bar) as told,
    ):
        carried_out(ensemble, place, told)
    outcome = outcome_of(place.file)
    if outcome.nothing and outcome.reasons:
        refusal = refusal_of(ensemble, outcome.reasons[0][0])
        if isinstance(refusal, ConfigError):  # wrong input, such as a mistyped path of vary
            raise refusal
    for words in (*outcome.troubles(partial(told_where, ensemble)), *coarse_members(outcome.largest_error)):
        say(f"hgorun: {run.name}: {words}")
    if outcome.nothing:
        raise SimulationError(f"{run.name}: none of its {outcome.members} members could be carried out")
    found = _divided(read_sweep(place.file), file=str(place.file))
    if options.text:
        print(tables.text([found], pairs=False))
        print(written([place.file], before))
    return plain_tables.as_json(found), found.members.all_ok


def report(options: Report) -> int:
    """Write the page of an ensemble.

    Raises
    ------
    ConfigError
        For axes, values and metrics that do not exist, and a file that cannot be read.
    HgorunError
        When bokeh is missing, or the page cannot be written.
    """
    from hgorun.explore.page import write_page

    refuse_other_kinds(options.output, _PAGES, default=RESULTS)
    refuse_name_of_another_thing(options.source)
    note_originals([options.source])
    found = _compared(read_sweep(options.source), options, str(options.source))
    if not found.members.observers:
        raise ConfigError("it has no observers, so there is nothing to report", file=str(options.source))
    _tell_coarse(found.members)
    output = options.output or RESULTS
    path = write_page(found, output if output.suffix.lower() in _PAGES else output / f"{found.members.name}.html")
    if options.json:
        print(json_text.dumps({"file": str(path)}, indent=2))
    elif not options.quiet:
        print(f"written: {path}")
    return 0


def draw(found: Compared, options: Compare) -> list[Path]:
    """Draw the figures that an ensemble has the numbers for; into one file only the first of them."""
    from hgorun.figures.ensembles import figures_of
    from hgorun.figures.files import save

    output = options.output or RESULTS
    figures = figures_of(found.members, options.metrics, page=Page.named(options.width, options.style))
    if output.suffix.lower() in DRAWING_SUFFIXES:
        return [
            path for _, figure in islice(figures, 1) for path in save(figure, output.with_suffix(""), formats(output))
        ]
    return [path for kind, figure in figures for path in save(figure, output / f"{found.members.name}-{kind}")]


def _tell_coarse(members: Collected) -> None:
    """Numbers that are not as exact as they look are told."""
    for words in coarse_members(largest_of_ok(members.observers, members.integration_error, members.status)):
        say(f"hgorun: {members.name}: {words}")


def _tell_nothing_to_draw(members: Collected) -> None:
    """Of an ensemble in which all observers are lost, why no figure is drawn; the table says where there are none."""
    if members.sound.any() or not members.observers:
        return
    counts = "; ".join(f"{label}: {_in_words(of)}" for label, of in members.counts.items())
    say(
        f"hgorun: {members.name}: no figure is drawn: no member has numbers of an observer ({counts}); "
        "hgorun simulate, with the values of a member by --set, says why"
    )


def _in_words(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {status}" for status, count in counts.items())


def _style(options: Compare) -> Style:
    """The table asked for, once it is sure that the options fit each other."""
    styles: dict[str, Style] = {"text": tables.text, "csv": plain_tables.csv, "latex": latex}
    refuse_other("--format", options.format, FORMATS)
    refused = {
        "--set": options.overrides,
        "--seed": options.seed is not None,
        "--run": options.run is not None,
        "--analyze": options.analyze,
    }
    for option, given in refused.items():
        if given:
            raise ConfigError(f"{option} is for configurations; these are ensembles that have been carried out")
    return styles[options.format]


def _compared(members: Collected, options: OfEnsembles, file: str) -> Compared:
    """The statistics that are asked for."""
    for name in options.metrics:
        if name not in members.metrics:
            hint = nearest(name, members.metrics)
            known = ", ".join(members.metrics)
            raise ConfigError(f"--metric: the ensemble has no metric {name!r}.{hint} Known: {known}", file=file)
    members = selected(members, options.at)
    return compared(members, _axes(members, options), options.metrics, file)


def selected(members: Collected, at: Sequence[str]) -> Collected:
    """The members with certain values.

    Parameters
    ----------
    members : Collected
    at : sequence of str
        ``axis=value`` each.
    """
    for text in at:
        name, sign, value = text.partition("=")
        if not sign:
            raise ConfigError(f"--at: expected AXIS=VALUE, found {text!r}")
        members = members.where(members.at(members.axis(name.strip()), value.strip()))
    return members


def _divided(members: Collected, *, file: str) -> Compared:
    """The statistics of an ensemble, divided by all axes but the seed while that makes a readable table."""
    return compared(members, _readable(members), file=file)


def _axes(members: Collected, options: OfEnsembles) -> tuple[str, ...]:
    """By which axes the members are divided: those named, or as is readable."""
    if options.by == [_TOGETHER]:
        return ()
    return tuple(members.axis(name) for name in options.by) or _readable(members)


def _readable(members: Collected) -> tuple[str, ...]:
    """All axes that were chosen and not drawn while they make a readable table, else none."""
    count = 1
    for axis in members.grid:
        count *= len(levels(members.axes[axis]))
    return members.grid if count <= _MOST_POINTS else ()


def of_one_kind(options: Compare) -> tuple[Compare, bool]:
    """The options with sources that can be compared, and whether these are ensembles; others are told.

    Single runs are compared where there are some, unless something is asked for that only ensembles have.
    """
    kinds = [is_sweep(path) for path in options.sources]
    if all(kinds) or not any(kinds):
        return options, all(kinds)
    wanted, sources = options.of_ensembles, zip(options.sources, kinds, strict=True)
    found = {wanted: list[Path](), not wanted: list[Path]()}
    for path, kind in sources:
        found[kind].append(path)
    taken, left = found.values()
    of_taken, of_left = ("ensembles", "single runs") if wanted else ("single runs", "ensembles")
    others = " ".join(shlex.quote(str(path)) for path in left)
    say(f"hgorun: compared are the {of_taken}; {of_left} are left out: hgorun compare {others} compares them")
    return replace(options, sources=taken), wanted
