"""The options of each command, written once: the command line makes its parameters and its help from them.

Only typer is imported here, so that help appears at once; annotations are evaluated, since the command line reads them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Printing:
    """What is printed, and where files go."""

    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File or folder to write to (default: results).")
    ] = None
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False
    json: Annotated[bool, typer.Option("--json", help="Print only JSON on stdout.")] = False

    @property
    def text(self) -> bool:
        """Whether text for a person is printed."""
        return not self.quiet and not self.json


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Configured(Printing):
    """Which runs of a configuration are meant, and what is changed in them."""

    overrides: Annotated[
        list[str],
        typer.Option("--set", metavar="PATH=VALUE", help="Change a key, e.g. observers.SHGO.theta=2; repeatable."),
    ] = field(default_factory=list)
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Override the seed in the file.")] = None
    run: Annotated[str | None, typer.Option("--run", help="Only this run of the file (default: all).")] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Drawing:
    """How figures are drawn."""

    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw figures (PNG and PDF).")] = True
    width: Annotated[
        str, typer.Option("--width", metavar="COLUMNS", help="Width of figures: one or two columns of a journal.")
    ] = "two"
    style: Annotated[str, typer.Option("--style", help="Page that figures are for: light or dark.")] = "light"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Simulate(Configured):
    """Simulate configurations, write results/NAME.h5 and print the metrics."""

    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="YAML configurations.")]
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")] = False
    check_step: Annotated[
        bool, typer.Option("--check-step", help="Estimate the error of a given step from shorter ones.")
    ] = False
    export_csv: Annotated[
        Path | None, typer.Option("--export-csv", metavar="FILE", help="Also write the states over time as CSV.")
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Estimate(Configured, Drawing):
    """Run the observers of a configuration on recorded data, and score them without a truth.

    The key data of the configuration says which columns are the measurements; nothing is simulated. Writes
    results/NAME.h5.
    """

    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="A YAML configuration with the key data.")]
    data: Annotated[
        list[str],
        typer.Argument(
            metavar="[DATA...]",
            help="Files with the data, in place of data.file; - or mqtt://HOST/TOPIC follows a stream.",
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
        typer.Option("--every", metavar="STEP", help="With a stream: print estimates at multiples of this time."),
    ] = None
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            "--checkpoint", metavar="FILE", help="With a stream: resume from this file, and keep it up to date."
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
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity/--no-sensitivity", help="Report how the scores depend on each gain.")
    ] = True
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Sweep(Printing):
    """Run the members of a sweep file, and collect them in results/NAME.sweep.h5.

    Run again, it continues with the members that are missing. Of a configuration it takes
    the runs with seeds or vary.
    """

    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A YAML file with base, axes and keep, or a configuration.")
    ]
    run: Annotated[str | None, typer.Option("--run", help="Only this run of a configuration (default: all).")] = None
    fresh: Annotated[bool, typer.Option("--fresh", help="Start over, whatever was finished before.")] = False
    part: Annotated[
        str | None, typer.Option("--part", metavar="K/N", help="Only this part of N, for array jobs; see hgorun merge.")
    ] = None
    collect: Annotated[bool, typer.Option("--collect", help="Run nothing; collect the members that are finished.")] = (
        False
    )
    executor: Annotated[str, typer.Option("--executor", help="threads, processes or dask.")] = "threads"
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Address of a dask scheduler (default: local workers)."),
    ] = None
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Threads, processes or workers (default: one per processor).")
    ] = None
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Merge(Printing):
    """Put the parts of a sweep together, and collect them in results/NAME.sweep.h5."""

    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Folders NAME.sweep with finished parts.")]
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Rerun(Printing):
    """Compute a result again from its own file, and compare the two bit for bit.

    The new result is written next to FILE as NAME.rerun.h5.
    """

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A result file.")]
    check: Annotated[bool, typer.Option("--check", help="Write nothing; exit with code 3 if any number differs.")] = (
        False
    )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class OfEnsembles(Printing):
    """What is told of ensembles."""

    metrics: Annotated[
        list[str], typer.Option("--metric", metavar="NAME", help="For ensembles: only this metric; repeatable.")
    ] = field(default_factory=list)
    by: Annotated[
        list[str],
        typer.Option(
            "--by", metavar="AXIS", help="For ensembles: a row for each value of this axis, or `none`; repeatable."
        ),
    ] = field(default_factory=list)
    at: Annotated[
        list[str],
        typer.Option("--at", metavar="AXIS=VALUE", help="For ensembles: only members with this value; repeatable."),
    ] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Compare(Configured, OfEnsembles, Drawing):
    """Compare metrics side by side, and draw comparison plots.

    For an ensemble (NAME.sweep.h5, or the folder NAME.sweep while it is running): statistics over its members.
    """

    sources: Annotated[
        list[Path], typer.Argument(metavar="SOURCE...", help="Configurations, result files, or ensembles.")
    ]
    format: Annotated[str, typer.Option("--format", help="Format of the table: text, csv or latex.")] = "text"
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")] = False
    analyze: Annotated[bool, typer.Option("--analyze", help="Add the numbers that theory predicts.")] = False

    @property
    def of_ensembles(self) -> bool:
        """Whether something is asked for that only ensembles have."""
        return bool(self.metrics or self.by or self.at)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Report(OfEnsembles):
    """Write a report of an ensemble: one HTML page with figures to zoom and tables to sort.

    The page is self-contained and needs no network. It is written to results/NAME.html; needs hgorun[explore].
    """

    source: Annotated[Path, typer.Argument(metavar="SWEEP", help="NAME.sweep.h5, or the folder NAME.sweep.")]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tune(Printing):
    """Find gains for a stated trade-off, and write the tuned configuration with the evidence.

    The key tune of the configuration says which gains, what is minimised, and over how many seeds.
    """

    config: Annotated[
        Path, typer.Argument(metavar="CONFIG", help="A configuration with the key tune, or a file with base and tune.")
    ]
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="[DATA...]", help="Recordings in place of data.file, one a file: the score is of all of them."
        ),
    ] = field(default_factory=list)
    overrides: Annotated[
        list[str], typer.Option("--set", metavar="tune.KEY=VALUE", help="Change a key of tune; repeatable.")
    ] = field(default_factory=list)
    run: Annotated[str | None, typer.Option("--run", help="Which run of the file, where it has several.")] = None
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw what was tried and found (PNG and PDF).")] = (
        True
    )
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Number of threads (default: one per processor).")
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Bench(Printing):
    """Compare observers on several plants in several scenarios, each tuned alike and scored on seeds not seen.

    The file names plants, scenarios and observers with one knob each. Run again, it carries out what is new or has
    changed. Tables and a figure are written to results/NAME/.
    """

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A YAML file with plants, scenarios and observers.")]
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw the fronts (PNG and PDF).")] = True
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Number of threads (default: one per processor).")
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Export(Configured):
    """Write the observers of a configuration in another language, to results/NAME/.

    As C: one file and a header for each observer, without allocation or libraries other than libm, with the method
    and the step of the run. As LaTeX: its equations with the numbers in them. As a
    unit (FMU): for other simulators.
    """

    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="A YAML configuration.")]
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder to write to (default: results/NAME).")
    ] = None
    lang: Annotated[str, typer.Option("--lang", metavar="LANGUAGE", help="c or latex.")] = "c"
    fmu: Annotated[
        bool,
        typer.Option("--fmu", help="Write FMI units for co-simulation, which contain the C code, instead of C files."),
    ] = False
    fmi: Annotated[str, typer.Option("--fmi", metavar="VERSION", help="FMI version for --fmu: 3.0 or 2.0.")] = "3.0"
    observers: Annotated[
        list[str], typer.Option("--observer", metavar="LABEL", help="Only this observer; repeatable.")
    ] = field(default_factory=list)
    single: Annotated[bool, typer.Option("--float", help="Use float instead of double.")] = False
    late: Annotated[
        float,
        typer.Option("--late", min=0, help="Largest delay of a sample (default: the delay of the configuration)."),
    ] = 0.0
    inputs_given: Annotated[
        bool,
        typer.Option("--inputs-given", help="Pass the inputs to the observer (default: those of the file)."),
    ] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Analyze(Configured, Drawing):
    """Compare theory with simulation: gains, bounds, noise."""

    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="A YAML configuration.")]
    search: Annotated[
        bool,
        typer.Option("--search", help="Search for the largest theta that fails below the working range."),
    ] = False
