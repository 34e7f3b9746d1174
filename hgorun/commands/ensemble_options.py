"""The options of the commands about many runs: comparisons, ensembles and what is made of them.

Only typer is loaded with it, as in :mod:`hgorun.commands.options`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from hgorun.commands import completion
from hgorun.commands.numbers import whole
from hgorun.commands.options import Configured, Drawing, Printing, Strict, WhichRun

FORMATS = ("text", "csv", "latex")
"""Of tables."""

Threads = Annotated[
    int | None,
    typer.Option(
        "--jobs", parser=whole("--jobs", 1), metavar="INTEGER", help="Number of threads (default: one per processor)."
    ),
]
"""Of commands that carry out many runs within this process."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Sweep(Printing):
    """Run the members of a sweep into results/NAME.sweep.h5.

    Run again, it continues with the members that are missing. Members that fail are reported
    at the end; the exit code is 1 only if all of them fail. Of a configuration, the runs
    with seeds or vary are taken.
    """

    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A YAML file with base, axes and keep, or a configuration.",
            autocompletion=completion.yaml_files,
        ),
    ]
    run: Annotated[
        str | None,
        typer.Option(
            "--run",
            metavar="NAME",
            help="Only this run of a configuration (default: all).",
            autocompletion=completion.runs,
        ),
    ] = None
    fresh: Annotated[bool, typer.Option("--fresh", help="Start over, whatever was finished before.")] = False
    part: Annotated[
        str | None, typer.Option("--part", metavar="K/N", help="Only this part of N, for array jobs; see hgorun merge.")
    ] = None
    collect: Annotated[bool, typer.Option("--collect", help="Run nothing; collect the members that are finished.")] = (
        False
    )
    executor: Annotated[
        str,
        typer.Option(
            "--executor",
            metavar="KIND",
            help="threads, processes or dask.",
            autocompletion=completion.one_of("threads", "processes", "dask"),
        ),
    ] = "threads"
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Address of a dask scheduler (default: local workers)."),
    ] = None
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            parser=whole("--jobs", 1),
            metavar="INTEGER",
            help="Threads, processes or workers (default: one per processor).",
        ),
    ] = None
    strict: Strict = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Merge(Printing):
    """Join the parts of a sweep into results/NAME.sweep.h5."""

    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Folders NAME.sweep with finished parts.")]
    strict: Strict = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class OfEnsembles(Printing):
    """What is told of ensembles."""

    metrics: Annotated[
        list[str],
        typer.Option(
            "--metric",
            metavar="NAME",
            help="For ensembles: only this metric; repeatable.",
            autocompletion=completion.metrics,
        ),
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
        list[Path],
        typer.Argument(
            metavar="SOURCE...",
            help="Configurations, names of built-in experiments, result files, or ensembles.",
            autocompletion=completion.sources,
        ),
    ]
    format: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="Format of the table: text, csv or latex.",
            autocompletion=completion.one_of(*FORMATS),
        ),
    ] = "text"
    strict: Strict = False
    analyze: Annotated[bool, typer.Option("--analyze", help="Add the numbers that theory predicts.")] = False

    @property
    def of_ensembles(self) -> bool:
        """Whether something is asked for that only ensembles have."""
        return bool(self.metrics or self.by or self.at)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Report(OfEnsembles):
    """Write a report of an ensemble as one HTML page.

    Figures can be zoomed and tables sorted; the page is self-contained and needs no network. It is written to
    results/NAME.html; needs hgorun[explore].
    """

    source: Annotated[
        Path,
        typer.Argument(
            metavar="SWEEP", help="NAME.sweep.h5, or the folder NAME.sweep.", autocompletion=completion.results
        ),
    ]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tune(Printing, Drawing):
    """Find gains for a stated trade-off, with the evidence.

    The key tune of the configuration says which gains, what is minimised, and over how many seeds. The tuned
    configuration is written beside the evidence.
    """

    config: Annotated[
        Path,
        typer.Argument(
            metavar="CONFIG",
            help="A configuration with the key tune, or a file with base and tune.",
            autocompletion=completion.yaml_files,
        ),
    ]
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="[DATA...]",
            help="Recordings in place of data.file, one a file: the score is of all of them.",
            autocompletion=completion.logs,
        ),
    ] = field(default_factory=list)
    overrides: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="tune.KEY=VALUE",
            help="Change a key of tune, or any one of recorded data; repeatable.",
            autocompletion=completion.keys,
        ),
    ] = field(default_factory=list)
    run: WhichRun = None
    jobs: Threads = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Bench(Printing, Drawing):
    """Compare observers, tuned alike, on plants and scenarios.

    The file names plants, scenarios and observers with one knob each; scores are of seeds that tuning has not seen. Run
    again, it carries out what is new or has changed. Tables and a figure are written to results/NAME/.
    """

    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A YAML file with plants, scenarios and observers.",
            autocompletion=completion.yaml_files,
        ),
    ]
    jobs: Threads = None
