"""``tune``: gains for a stated trade-off, with the evidence."""

from __future__ import annotations

import json as json_text
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hgorun.commands.ensemble_options import Tune
from hgorun.commands.inputs import configuration
from hgorun.commands.outputs import RESULTS, refuse_other_kinds, refuse_unwritable, there, written
from hgorun.config.reading import read_source
from hgorun.config.written import rounded, with_values
from hgorun.ensemble.collected.units import units_of
from hgorun.errors import ConfigError, HgorunError
from hgorun.figures.page import Page
from hgorun.files import write_text
from hgorun.observers.capabilities import FilterOrder
from hgorun.process import say
from hgorun.progress import shown
from hgorun.result.metrics.base import unit_of
from hgorun.study.sentences import Sentence
from hgorun.tables import tuning as tables
from hgorun.tables.tuning import TunedTable
from hgorun.tables.uncertain import uncertain
from hgorun.tuning.evidence import Evidence, evidence
from hgorun.tuning.gain import at_an_end
from hgorun.tuning.loading import Asked, load_tuning
from hgorun.tuning.search import admissible, search
from hgorun.tuning.storing import save
from hgorun.tuning.task import Task, is_plain
from hgorun.tuning.trials import Trials


class _NothingFound(HgorunError):
    """No gains that were tried keep the estimate and meet the limits."""


def tune(options: Tune) -> int:
    """Find the gains that a file asks for, write the tuned configuration, what was tried, and a figure.

    Raises
    ------
    ConfigError
        For anything wrong in the file.
    HgorunError
        When of no observer any gains that were tried keep the estimate and meet the limits, or a file cannot be
        written. Those of whom none do beside others are told, and keep their gains; the exit code is 1.
    """
    refuse_other_kinds(options.output, (), default=RESULTS)
    page = Page.named(options.width, options.style)
    options = replace(options, config=configuration(options.config, "tune"))
    text, source = read_source(options.config, options.overrides)
    blocks = source.data.keys() if isinstance(source.data, dict) else set()
    if {"data", "tune"} <= blocks:
        from hgorun.commands.tune_data import tune_data

        return tune_data(options, text, source)
    if options.data and "data" not in blocks:
        raise ConfigError(f"{options.data[0]}: files are for recordings, and the configuration has no data")
    asked = load_tuning(options.config, options.overrides, run=options.run)
    folder = options.output or RESULTS
    targets = [folder / f"{asked.name}{suffix}" for suffix in (".tuned.yaml", ".tune.h5")]
    for target in targets:  # before the search: the configuration may extend one that was tuned
        refuse_unwritable(target, kind="file")
    found, missed = _all_tuned(asked, options)
    before = there(targets)
    files = _write(found, asked, options, page)
    told = [_table(one) for one in found]
    for one in found:
        _warn(one, asked.name)
    for words in missed:
        say(f"hgorun: {words}; it keeps its gains")
    if options.json:
        print(json_text.dumps(tables.as_json(told, asked.name, files), indent=2, allow_nan=False))
    elif not options.quiet:
        print(tables.text(told))
        print(written(files, before))
    return 1 if missed else 0


def _all_tuned(asked: Asked, options: Tune) -> tuple[list[Evidence], list[str]]:
    """What was found, and the reasons of those observers for which nothing was."""
    found, missed = [], []
    for task in asked.tasks:
        try:
            found.append(_tuned(task, asked.name, options))
        except _NothingFound as error:  # what was found for others is not lost with it
            missed.append(str(error))
    if not found:
        raise HgorunError("; ".join(missed))
    return found, missed


def _tuned(task: Task, name: str, options: Tune) -> Evidence:
    threads = options.jobs or os.cpu_count() or 1
    with shown(task.budget, f"{name}: {task.label}", "runs", show=options.text) as progress:
        trials = Trials(task, threads, progress.update)
        try:
            found = search(trials)
        except ValueError as error:
            raise _NothingFound(f"{name}: {task.label}: {error}") from None
    return evidence(found, threads)


def _warn(one: Evidence, name: str) -> None:
    """Gains at an end of their range, and limits that the held-out seeds do not meet, are reported on stderr."""
    for gain, value in zip(one.task.gains, one.gains[one.chosen].tolist(), strict=True):
        if told := at_an_end(one.task.base, gain, value):
            say(f"hgorun: {name}: {told}")
    mean, half = (part[one.chosen] for part in one.mean(held_out=True))
    for k, limit in enumerate(one.task.limits, start=len(one.task.goals)):
        if limit.excess(mean[k]) > 0:
            wanted = f"{'below' if limit.below else 'above'} {limit.bound:g}"
            found = uncertain(float(mean[k]), float(half[k]))
            say(f"hgorun: {name}: on held-out seeds {limit.text} is {found}, not {wanted}")


def _write(found: Sequence[Evidence], asked: Asked, options: Tune, page: Page) -> list[str]:
    folder = options.output or RESULTS
    numbers = {path: rounded(value) for one in found for path, value in one.tuned.items()}
    config = folder / f"{asked.name}.tuned.yaml"
    write_text(config, with_values(asked.config, numbers, config, run=asked.run))
    files = [config, save(found, folder / f"{asked.name}.tune.h5", name=asked.name, config=asked.text)]
    if options.plots:
        files += _draw(found, folder / f"{asked.name}.tune", page)
    return [str(file) for file in files]


def _draw(found: Sequence[Evidence], path: Path, page: Page) -> list[Path]:
    from hgorun.figures.files import save as save_figure
    from hgorun.figures.tuning import Tuned, tuning

    drawn = []
    for one in found:
        trials, count = one.found.trials, len(one.task.goals)
        label = one.task.label
        block = one.task.base.observers.get(label)
        front, half = one.mean(held_out=True)
        drawn.append(
            Tuned(
                label=label,
                type=block.type if block is not None else "",
                filter_order=block.r if isinstance(block, FilterOrder) else None,
                paths=tuple(gain.path for gain in one.task.gains),
                units=_units(one.task),
                logarithmic=tuple(gain.range.log is not None for gain in one.task.gains),
                gains=trials.gains[trials.complete],
                goals=trials.means[trials.complete][:, :count],
                met=admissible(trials)[trials.complete],
                front_gains=one.gains,
                front=front[:, :count],
                half=half[:, :count],
                chosen=one.chosen,
            )
        )
    return save_figure(tuning(drawn, _names(found), page), path)


def _names(found: Sequence[Evidence]) -> list[str]:
    """What axes call the goals: metrics by their names; expressions as they were written, but for whose they are."""
    from hgorun.figures.ensemble import quantity_label

    task = found[0].task
    whose = re.compile(rf"'{re.escape(task.label)}'\s*,\s*")  # the legend tells it
    names = []
    for text, sentence in task.goals:
        quantity = sentence.quantities[0]
        label = quantity_label(quantity.function, str(quantity.state), _units(task))
        names.append(label if is_plain(sentence) else whose.sub("", text))
    return names


def _units(task: Task) -> dict[str, str]:
    return units_of(task.base, (gain.path for gain in task.gains))


def _unit(sentence: Sentence, task: Task) -> str:
    """What a quantity is measured in; of an expression of several it is not known."""
    quantity = sentence.quantities[0]
    return unit_of(quantity.function, str(quantity.state), _units(task)) if is_plain(sentence) else ""


def _table(one: Evidence) -> TunedTable:
    (tuned, tuned_half), (held_out, held_out_half) = one.mean(held_out=False), one.mean(held_out=True)
    task = one.task
    return TunedTable(
        label=task.label,
        paths=tuple(gain.path for gain in task.gains),
        quantities=tuple([*(text for text, _ in task.goals), *(limit.text for limit in task.limits)]),
        goals=len(task.goals),
        gains=one.gains,
        tuned=tuned,
        tuned_half=tuned_half,
        held_out=held_out,
        held_out_half=held_out_half,
        lost=np.isinf(one.held_out).any(axis=2).sum(axis=1),
        confidence=one.confidence,
        chosen=one.chosen,
        runs=one.found.trials.spent,
        budget=task.budget,
        ended=one.found.ended,
        seeds=len(task.seeds),
        held_out_seeds=len(task.held_out),
        units=tuple(_unit(sentence, task) for sentence in task.sentences),
        of_gains=_units(task),
    )
