"""``estimate``: observers on recorded data."""

from __future__ import annotations

import json as json_text
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hgorun.commands.exported_samples import export_samples
from hgorun.commands.inputs import configuration
from hgorun.commands.kept import tell_what_runs_keep
from hgorun.commands.mqtt_address import is_address
from hgorun.commands.outputs import (
    NOT_OK,
    RESULTS,
    refuse_no_csv,
    refuse_other_kinds,
    refuse_same,
    refuse_unwritable,
    there,
    written,
)
from hgorun.commands.run_options import Estimate
from hgorun.config.kinds import refuse_file_of_another_command
from hgorun.config.nearest import MEASURED, no_file
from hgorun.config.reading import read_source
from hgorun.config.yaml_source import Source
from hgorun.data.recording import Recording, Signal
from hgorun.errors import ConfigError, HgorunError
from hgorun.estimate.holdout import HoldOut, expected_of, held_out, number_of, of_one_time, parse_holdout, thinned
from hgorun.estimate.log import Log, log_of
from hgorun.figures.page import Page
from hgorun.files import RESULT_SUFFIXES, refuse_original, remove_leftovers, write_text
from hgorun.originals import note_originals
from hgorun.process import keep_memory, say, take_short_turns
from hgorun.study.split import split

if TYPE_CHECKING:
    from hgorun.result.result import Result  # what takes long to import is imported while files are read


def estimate(options: Estimate) -> int:
    """Run the observers of a configuration on recorded data and write the result."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES, {".csv": "--export-csv FILE writes the estimates"})
    refuse_no_csv("--export-csv", options.export_csv)
    refuse_no_csv("--export-samples", options.export_samples, or_stdout=True)
    if options.checkpoint is not None:
        refuse_unwritable(options.checkpoint, "--checkpoint", "file")
    _refuse_with_samples(options)
    page = Page.named(options.width, options.style)
    options = replace(options, config=configuration(options.config, "estimate"))
    text, source = read_source(options.config, options.overrides, seed=options.seed)
    refuse_file_of_another_command(source.data, options.config)
    if options.checkpoint is not None:
        refuse_original(options.checkpoint, "--checkpoint")
    source, name = one_run(source, options.config, options.run)
    tell_what_runs_keep(options.config, options)
    if "-" in options.data:
        from hgorun.commands.stream import follow

        return follow(source, name, options)
    if any(map(is_address, options.data)):
        from hgorun.commands.mqtt import follow_topic

        return follow_topic(source, name, options)
    of_streams = (options.every, options.checkpoint, options.remembered, options.publish, options.client_id)
    if any(one is not None for one in of_streams):
        raise ConfigError(
            "--every, --checkpoint, --remembered, --publish and --client-id are for streams: "
            "hgorun estimate CONFIG -, or hgorun estimate CONFIG mqtt://HOST/TOPIC"
        )
    if isinstance(source.data, dict) and source.data.get("figures"):
        say(f"hgorun: {name}: figures of recorded data have all states and the whole run: the key figures is not used")
    log = log_of(source, options.config, tuple(map(Path, options.data)))
    note_originals([*log.all_files, *(Path(what) for _, what in map(parse_holdout, options.holdout))])
    if options.export_samples is not None:
        refuse_original(options.export_samples, "--export-samples")
        with source.located():
            from hgorun.commands.remarks import of_run

            recording = log.read()
            for note in recording.notes:
                say(f"hgorun: {of_run(name, str(note))}")
            return export_samples(recording, options.export_samples, quiet=not options.text)
    keep_memory()
    take_short_turns()
    target = _target(options, name)
    _refuse_to_overwrite(options, target)
    refuse_unwritable(target, kind="file")
    with source.located(), ThreadPoolExecutor(1) as pool:
        files = pool.submit(log.open)
        # what takes longest to import, while machine code reads the files
        from hgorun.commands.remarks import of_run, warn
        from hgorun.estimate.completed import ready
        from hgorun.estimate.estimate import estimate as estimated
        from hgorun.estimate.long.long_log import estimate_into
        from hgorun.estimate.scores.shut_out import shut_out

        ready(source)
        recording, aside = _held_out(log, log.read(files.result), options)
    del files
    notes = recording.notes
    before = there([target, *([] if options.export_csv is None else [options.export_csv])])
    remove_leftovers(target.parent)
    try:
        result = None
        if options.export_csv is None:  # which has all estimates
            result = estimate_into(
                source, recording, target, name=name, text=text, held_out=aside, sensitivity=options.sensitivity
            )
        if result is None:
            result = estimated(source, recording, name=name, text=text, held_out=aside, sensitivity=options.sensitivity)
            result.save(target)
    except HgorunError:
        for note in notes:  # what was found in the log may be why
            print(f"hgorun: {of_run(name, str(note))}", file=sys.stderr)
        raise
    del recording, aside  # while a thread gives back the room of a large result that was replaced: both take a while
    file = str(target)
    warn(result)
    told = [target, *_also_written(options, page, result, target)]
    if options.json:
        from hgorun.tables.metrics import as_json

        print(json_text.dumps(as_json(result, file), indent=2, allow_nan=False))
    elif options.text:
        from hgorun.tables.metrics import text as table

        print(table([result]))
        if result.recorded is not None and result.recorded.time_origin:
            print(f"time 0 is {result.recorded.time_origin}")
        print(written(told, before))
    return NOT_OK if options.strict and (result.status != "ok" or any(shut_out(result))) else 0


def one_run(source: Source, config: Path, run: str | None) -> tuple[Source, str]:
    """The run of a file that is meant, and what it is called."""
    name = config.stem
    if not isinstance(source.data, dict) or "runs" not in source.data:
        if run is not None:
            message = f"the file has no runs, so none is called {run!r}"
            raise ConfigError(message, file=str(config))
        return source, name
    runs = split(source)
    if run not in runs:
        file, line = source.where(("runs",))
        known = ", ".join(runs)
        raise ConfigError(f"name one of the runs {known} with --run", file=file, line=line, key="runs")
    return runs[run][0], run


def _held_out(log: Log, recording: Recording, options: Estimate) -> tuple[Recording, dict[str, Signal]]:
    whole = recording
    recording, between = thinned(recording, log.block.period)
    chosen: list[HoldOut] = []
    aside: dict[str, Signal] = {}
    for text in options.holdout:
        output, what = parse_holdout(text)
        if output in aside or any(one.output == output for one in chosen):
            raise ConfigError(f"--holdout {text}: samples of {output} are held out already")
        every = number_of(output, what)
        if every is None:
            if not os.path.isfile(what):
                why = f"{what}: {no_file(Path(what), MEASURED)}"
                raise ConfigError(f"--holdout {text}: {expected_of(output, what)}; {why}")
            recording, aside[output] = log.held_out(recording, output, Path(what))
        else:
            chosen.append(every)
    recording, found = held_out(recording, chosen)
    recording = replace(recording, notes=(*recording.notes, *of_one_time(whole, recording)))
    return recording, {**between, **aside, **found}


def _target(options: Estimate, name: str) -> Path:
    if options.output is not None and options.output.suffix.lower() in RESULT_SUFFIXES:
        return options.output
    return (options.output or RESULTS) / f"{name}.h5"


def _refuse_with_samples(options: Estimate) -> None:
    """What is not written where samples are."""
    if options.export_samples is not None and options.asks_for_a_result:
        raise ConfigError("--export-samples estimates nothing: leave out --holdout, --export-csv and --output")


def _refuse_to_overwrite(options: Estimate, target: Path) -> None:
    """Refuse to write where something is read from, or written otherwise: a recording cannot be made once more."""
    refuse_original(target, "--output")
    if options.export_csv is not None:
        refuse_original(options.export_csv, "--export-csv")
        refuse_same(options.export_csv, [target])


def _also_written(options: Estimate, page: Page, result: Result, target: Path) -> list[Path]:
    """Figures, and the estimates as text."""
    files: list[Path] = []
    if options.export_csv is not None:
        from hgorun.tables.trajectories import csv

        write_text(options.export_csv, csv(result))
        files.append(options.export_csv)
    if options.plots:
        from hgorun.figures.drawing import comparison
        from hgorun.figures.files import save

        files += save(comparison(result, page), target.with_suffix(""))
    return files
