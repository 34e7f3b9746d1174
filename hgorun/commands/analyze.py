"""``analyze``: theory beside simulation."""

from __future__ import annotations

import json as json_text
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Any

from hgorun.analysis.report import analysis_of
from hgorun.analysis.subject import Context
from hgorun.commands.inputs import configuration
from hgorun.commands.kept import tell_what_runs_keep
from hgorun.commands.outputs import RESULTS, formats, refuse_other_kinds, there, written
from hgorun.commands.remarks import warn
from hgorun.commands.run import run_with_progress
from hgorun.commands.run_options import Analyze
from hgorun.config.reading import read_source
from hgorun.config.shell import assigned
from hgorun.errors import ConfigError
from hgorun.figures.page import Page
from hgorun.plants.names import states_of
from hgorun.simulation.experiment.blocks import of_a_log
from hgorun.simulation.simulate import prepare
from hgorun.study.loading import experiment_of
from hgorun.tables import analysis as table
from hgorun.tables.advice import advice

_FIGURES = {".png", ".pdf"}


def analyze(options: Analyze) -> int:
    """Say what theory promises for a configuration, and draw the transients that it bounds."""
    refuse_other_kinds(options.output, _FIGURES, default=RESULTS if options.plots else None)
    page = Page.named(options.width, options.style)
    options = replace(options, config=configuration(options.config, "analyze"))
    stem = options.config.stem
    target = _target(stem if options.run is None else f"{stem}-{options.run}", options.output)
    text, source = read_source(options.config, options.overrides, seed=options.seed)
    _refuse_recording(options.config, source.data)
    try:
        run = prepare(experiment_of(text, source, options.config, options.run))
    except ConfigError as error:
        raise _told_of_the_log(error, source.data) from error
    tell_what_runs_keep(options.config, options)
    result = run_with_progress(run, show=options.text)
    warn(result)
    analysis = analysis_of(run, result, search=options.search)
    drawn: list[list[Path]] = []
    before = there([] if options.output is None else [options.output])
    if options.plots and analysis.transients:
        from hgorun.figures.files import save
        from hgorun.figures.peaking import peaking

        drawn.append(save(peaking(result, analysis.transients, page), target, formats(options.output)))
    if options.plots:
        bode = target.with_name(target.name.removesuffix("-analysis") + "-bode")
        drawn.append(_bode(analysis.context, page, bode, formats(options.output)))
    if options.json:
        found = analysis.as_json(str(options.config)) | {"figures": [str(file) for files in drawn for file in files]}
        print(json_text.dumps(found, indent=2, allow_nan=False))
    elif not options.quiet:
        print("\n".join(advice(analysis)))
        print(f"\n{table.text(analysis)}" if options.verbose else "every number, and why others are missing: -v")
        for files in filter(None, drawn):
            print(written(files, before))
    return 0


def _refuse_recording(path: Path, data: object) -> None:
    """Of a configuration of recorded data, say how its observers are analysed along a way of the model.

    Raises
    ------
    ConfigError
    """
    if not (isinstance(data, dict) and of_a_log(data)):
        return
    plant, time, log = (_mapping(data, key) for key in ("plant", "time", "data"))
    inputs, outputs = _mapping(log, "inputs"), _mapping(log, "outputs")
    noise = _noise_of_log(log)
    examples: dict[tuple[str, ...], object] = {
        ("data",): "null",
        ("tune",): "null" if "tune" in data else None,
        ("time", "end"): None if "end" in time else 10,
        ("time", "output_step"): None if "output_step" in time else 0.01,
        ("measurement", "sampling", "period"): log.get("period", time.get("output_step", 0.01)),
        ("measurement", "noise"): noise,
        ("plant", "inputs"): _ones(inputs) if inputs and "inputs" not in plant else None,
        ("plant", "initial"): _ones(states_of(plant)) if "initial" not in plant else None,
        **_first_samples(data, plant, outputs),
    }
    words = " ".join(assigned(path, str(value)) for path, value in examples.items() if value is not None)
    file = quote(str(path))
    raise ConfigError(
        "this configuration is of recorded data, and limits and noise follow from a way of the plant, which no log "
        f"has: `hgorun analyze {file} {words}` analyses the observers along a way of the model, with your period, end "
        f"and start in place of these; `hgorun estimate {file}` runs them on the log, and says of one that diverges if "
        "its theta is too large for the period",
        file=str(path),
    )


def _noise_of_log(log: Mapping[str, Any]) -> str | None:
    """Noise as strong as the first ``std`` of the outputs of a log; None where no output has one."""
    outputs = _mapping(log, "outputs").values()
    std = next((one["std"] for one in outputs if isinstance(one, dict) and "std" in one), None)
    return None if std is None else f"[{{type: gaussian, std: {std}}}]"


def _told_of_the_log(error: ConfigError, data: object) -> ConfigError:
    """Where an R is missing beside the std of a log, which is no noise of a run: the same error, with that noise."""
    noise = _noise_of_log(_mapping(data, "data")) if isinstance(data, dict) else None
    if noise is None or error.key is None or not error.key.endswith(".R"):
        return error
    words = assigned(("measurement", "noise"), noise)
    message = f"{error.message}, or noise: this is a run of the plant, and the std in data is of the log; add {words}"
    told = ConfigError(message, file=error.file, line=error.line, key=error.key)
    told.add_others(error.others)
    return told


def _first_samples(
    data: Mapping[str, Any], plant: Mapping[str, Any], outputs: Iterable[str]
) -> dict[tuple[str, ...], object]:
    """Starts of measured states where an observer gives none: those are the first samples of a log, and 0 in a run."""
    states, own, start = states_of(plant), _mapping(plant, "output"), _mapping(plant, "initial")
    measured = [state for state in (own.get(output, output) for output in outputs) if state in states]
    found: dict[tuple[str, ...], object] = {}
    for label, block in _mapping(data, "observers").items():
        given = block.get("initial", {}) if isinstance(block, dict) else None
        if not isinstance(given, dict):
            continue
        missing = {state: start.get(state, 1) for state in measured if state not in given}
        if "initial" in block:
            found |= {("observers", label, "initial", state): value for state, value in missing.items()}
        elif missing:
            found["observers", label, "initial"] = _entries(missing)
    return found


def _mapping(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """What stands at a key, which nobody has checked yet; nothing where that is no mapping."""
    found = data.get(key)
    return found if isinstance(found, dict) else {}


def _ones(names: Iterable[str]) -> str:
    return _entries(dict.fromkeys(names, 1))


def _entries(values: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{name}: {value}" for name, value in values.items()) + "}"


def _target(name: str, output: Path | None) -> Path:
    """Where the figure goes, without a suffix."""
    if output is not None and output.suffix.lower() in _FIGURES:
        return output.with_suffix("")
    return (output or RESULTS) / f"{name}-analysis"


def _bode(context: Context, page: Page, target: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """The observers' frequency responses, where there are some."""
    from hgorun.analysis.noise.responses import frequency_responses
    from hgorun.figures.bode import bode_figure
    from hgorun.figures.files import save

    data = frequency_responses(context)
    return save(bode_figure(data, context.result, page), target, suffixes) if data.magnitude else []
