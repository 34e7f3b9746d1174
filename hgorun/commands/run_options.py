"""The options of the commands about single runs, estimates and observers.

Only typer is loaded with it, as in :mod:`hgorun.commands.options`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from hgorun.commands import completion
from hgorun.commands.numbers import not_negative, whole
from hgorun.commands.options import Configured, Drawing, OneConfig, OnlyRun, Overrides, Printing, Seed, Strict, WhichRun


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Simulate(Configured):
    """Simulate, write results/NAME.h5 and print the metrics."""

    configs: Annotated[
        list[Path],
        typer.Argument(
            metavar="CONFIG...",
            help="YAML configurations, or names of built-in experiments.",
            autocompletion=completion.configurations,
        ),
    ]
    strict: Strict = False
    check_step: Annotated[
        bool, typer.Option("--check-step", help="Estimate the error of a given step from shorter ones.")
    ] = False
    export_csv: Annotated[
        Path | None, typer.Option("--export-csv", metavar="FILE", help="Also write the states over time as CSV.")
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Estimate(Configured, Drawing):
    """Run observers on recorded data and score them without a truth.

    The key data of the configuration says which columns are the measurements; nothing is simulated. Writes
    results/NAME.h5.
    """

    config: Annotated[
        Path,
        typer.Argument(
            metavar="CONFIG", help="A YAML configuration with the key data.", autocompletion=completion.yaml_files
        ),
    ]
    data: Annotated[
        list[str],
        typer.Argument(
            metavar="[DATA...]",
            help="Files with the data, in place of data.file; - or mqtt://HOST/TOPIC follows a stream.",
            autocompletion=completion.logs,
        ),
    ] = field(default_factory=list)
    holdout: Annotated[
        list[str],
        typer.Option(
            "--holdout",
            metavar="OUTPUT=N|FILE",
            help="Set every N-th sample of an output aside, or compare with those in a file; repeatable.",
        ),
    ] = field(default_factory=list)
    every: Annotated[
        float | None,
        typer.Option(
            "--every",
            parser=not_negative("--every"),
            metavar="STEP",
            help="With a stream: print estimates at multiples of this time.",
        ),
    ] = None
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            "--checkpoint", metavar="FILE", help="With a stream: resume from this file, and keep it up to date."
        ),
    ] = None
    remembered: Annotated[
        int | None,
        typer.Option(
            "--remembered",
            parser=whole("--remembered", 1),
            metavar="N",
            help="With a stream: late samples may go back by so many samples (default: 1000).",
        ),
    ] = None
    publish: Annotated[
        str | None,
        typer.Option("--publish", metavar="TOPIC", help="With mqtt://: publish the estimates there."),
    ] = None
    client_id: Annotated[
        str | None,
        typer.Option(
            "--client-id",
            metavar="ID",
            help="With mqtt://: name at the broker (default: made of the checkpoint's place).",
        ),
    ] = None
    export_csv: Annotated[
        Path | None, typer.Option("--export-csv", metavar="FILE", help="Also write the estimates as CSV.")
    ] = None
    export_samples: Annotated[
        Path | None,
        typer.Option(
            "--export-samples",
            metavar="FILE",
            help="Write the samples as lines of a stream, in the model's units, and estimate nothing; - is the output.",
        ),
    ] = None
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity/--no-sensitivity", help="Report how the scores depend on each gain.")
    ] = True
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Exit with code 3 if a status is not ok, or a gate left out too many samples; of a stream at its end.",
        ),
    ] = False

    @property
    def asks_for_a_result(self) -> bool:
        """Whether something is asked for that only an estimate of recorded data has."""
        return bool(self.holdout) or self.export_csv is not None or self.output is not None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Rerun(Printing):
    """Compute a result again and compare the two bit for bit.

    The new result is written next to FILE as NAME.rerun.h5.
    """

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A result file.", autocompletion=completion.results)]
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PATH", help="File or folder to write to (default: beside FILE)."),
    ] = None
    check: Annotated[bool, typer.Option("--check", help="Write nothing; exit with code 3 if any number differs.")] = (
        False
    )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Explore:
    """Open a configuration in the browser, with sliders.

    Curves, errors, metrics and the bounds of the theory follow the sliders. The page is served on this machine alone,
    until Ctrl-C; chosen values are written as a new configuration. Needs hgorun[explore].
    """

    config: OneConfig
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="PATH",
            help="Folder, or YAML file, that values are written to (default: results).",
        ),
    ] = None
    overrides: Overrides = field(default_factory=list)
    seed: Seed = None
    run: WhichRun = None
    port: Annotated[
        int,
        typer.Option(
            "--port",
            parser=whole("--port", 0, 65535),
            metavar="INTEGER",
            show_default=False,
            help="Port on this machine (default: any that is free).",
        ),
    ] = 0
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser; else only say where it is.")
    ] = True
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but the address and errors.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Export(Configured):
    """Write observers as code or equations to results/NAME/.

    As C: one file and a header for each observer, without allocation or libraries other than libm, with the method
    and the step of the run. As LaTeX: its equations with the numbers in them. As a
    unit (FMU): for other simulators.
    """

    config: OneConfig
    run: WhichRun = None
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="Folder to write to (default: results/NAME).")
    ] = None
    lang: Annotated[
        str,
        typer.Option("--lang", metavar="LANGUAGE", help="c or latex.", autocompletion=completion.one_of("c", "latex")),
    ] = "c"
    fmu: Annotated[
        bool,
        typer.Option("--fmu", help="Write FMI units for co-simulation, which contain the C code, instead of C files."),
    ] = False
    fmi: Annotated[str, typer.Option("--fmi", metavar="VERSION", help="FMI version for --fmu: 3.0 or 2.0.")] = "3.0"
    observers: Annotated[
        list[str],
        typer.Option(
            "--observer",
            metavar="LABEL",
            help="Only this observer (default: all); repeatable.",
            autocompletion=completion.labels,
        ),
    ] = field(default_factory=list)
    single: Annotated[bool, typer.Option("--float", help="Use float instead of double.")] = False
    late: Annotated[
        float,
        typer.Option(
            "--late",
            parser=not_negative("--late"),
            metavar="TIME",
            show_default=False,
            help="Largest delay of a sample, where it is above that of the configuration or of the log.",
        ),
    ] = 0.0
    inputs_given: Annotated[
        bool,
        typer.Option("--inputs-given", help="Pass the inputs to the observer (default: those of the file)."),
    ] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Analyze(Configured, Drawing):
    """Say what theory knows: limits, margins, which gain to change.

    With -v every number follows: gains, bounds, peaking, noise predicted and measured, and why others are missing.
    """

    config: OneConfig
    run: WhichRun = None
    search: Annotated[
        bool,
        typer.Option("--search", help="Search for the largest theta that fails below the working range."),
    ] = False
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="Also print every number, and why others are missing.")
    ] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Cite(Printing):
    """Say what a configuration uses, and print it as BibTeX.

    Its publication, its plant, its observers, the method, hgorun and the libraries, with keys that do not change.
    """

    config: OneConfig
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="Write the BibTeX to this file (.bib).")
    ] = None
    run: OnlyRun = None
    bibtex: Annotated[bool, typer.Option("--bibtex", help="Print only BibTeX.")] = False
