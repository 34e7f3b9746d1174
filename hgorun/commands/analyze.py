"""``analyze``: theory beside simulation."""

from __future__ import annotations

import json as json_text
from dataclasses import replace
from pathlib import Path

from hgorun.analysis.report import analysis_of
from hgorun.analysis.subject import Context
from hgorun.commands.inputs import configuration
from hgorun.commands.outputs import RESULTS, formats, refuse_other_kinds, refuse_unwritable, there, written
from hgorun.commands.remarks import warn
from hgorun.commands.run import run_with_progress
from hgorun.commands.run_options import Analyze
from hgorun.errors import ConfigError
from hgorun.figures.page import Page
from hgorun.simulation.simulate import prepare
from hgorun.study.loading import load
from hgorun.tables import analysis as table
from hgorun.tables.advice import advice

_FIGURES = {".png", ".pdf"}


def analyze(options: Analyze) -> int:
    """Say what theory promises for a configuration, and draw the transients that it bounds."""
    refuse_other_kinds(options.output, _FIGURES)
    page = Page.named(options.width, options.style)
    options = replace(options, config=configuration(options.config, "analyze"))
    stem = options.config.stem
    target = _target(stem if options.run is None else f"{stem}-{options.run}", options.output)
    if options.plots:
        refuse_unwritable(target.parent, kind="folder")
    run = prepare(load(options.config, options.overrides, seed=options.seed, run=options.run))
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


def _target(name: str, output: Path | None) -> Path:
    """Where the figure goes, without a suffix."""
    if output is not None and output.suffix.lower() in _FIGURES:
        return output.with_suffix("")
    if output is not None and output.is_file():
        raise ConfigError(f"--output: {output} is a file; name a folder, or a figure with .png or .pdf")
    return (output or RESULTS) / f"{name}-analysis"


def _bode(context: Context, page: Page, target: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """The observers' frequency responses, where there are some."""
    from hgorun.analysis.noise.responses import frequency_responses
    from hgorun.figures.bode import bode_figure
    from hgorun.figures.files import save

    data = frequency_responses(context)
    return save(bode_figure(data, context.result, page), target, suffixes) if data.magnitude else []
