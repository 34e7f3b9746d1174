"""The options of the commands about what hgorun brings: its publications, and what it can be asked to describe.

Only typer is imported here, as in :mod:`hgorun.commands.options`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from hgorun.commands import completion
from hgorun.commands.numbers import whole
from hgorun.commands.options import Printing, Seed


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reproduction(Printing):
    """Which figures or claims are meant, and how many are made at once."""

    names: Annotated[
        list[str],
        typer.Argument(
            metavar="[NAME...]",
            help="Figures, experiments or folders of them, or YAML files.",
            autocompletion=completion.publications,
        ),
    ] = field(default_factory=list)
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            parser=whole("--jobs", 1),
            metavar="INTEGER",
            help="Number of processes (default: one per processor).",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Figures(Reproduction):
    """Draw the figures of the publications, or of your own files.

    Each is written as PNG and PDF. It is drawn again only if its block, its runs or the code it depends on has changed.
    """

    report: Annotated[bool, typer.Option("--report", help="Check the claims too, and write REPORT.md.")] = False
    width: Annotated[
        str | None,
        typer.Option(
            "--width",
            metavar="COLUMNS",
            help="One or two columns of a journal (default: what the file says).",
            autocompletion=completion.one_of("one", "two"),
        ),
    ] = None
    style: Annotated[
        str | None,
        typer.Option(
            "--style",
            metavar="STYLE",
            help="Page that figures are for: light or dark (default: what the file says).",
            autocompletion=completion.one_of("light", "dark"),
        ),
    ] = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Claims(Reproduction):
    """Check the claims of the publications, or of your own files.

    Each claim is confirmed or refuted, with the number; undecided where chance leaves it open; depends where the
    publication leaves open what decides; undecidable where no finite run can tell.
    Runs are kept in results/runs for other calls; the folder may be deleted.
    """

    seed: Seed = None
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with code 3 if a verdict is not the one that its file expects.")
    ] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class List:
    """List plants, observers, noise, metrics, findings, experiments."""

    kind: Annotated[
        str,
        typer.Argument(
            metavar="[KIND]",
            help="plants, observers, noise, metrics, findings, experiments or all.",
            autocompletion=completion.one_of(
                "plants", "observers", "noise", "metrics", "findings", "experiments", "all"
            ),
        ),
    ] = "all"
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Show:
    """Describe a plant, an observer or anything else of hgorun list.

    The description has its equations, its keys with ranges and defaults, and its source.
    """

    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A name from hgorun list.", autocompletion=completion.everything)
    ]
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Schema:
    """Print the JSON schema of configurations, for editors."""

    sweep: Annotated[bool, typer.Option("--sweep", help="The schema of sweep files instead.")] = False
    benchmark: Annotated[bool, typer.Option("--benchmark", help="The schema of benchmark files instead.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Doctor:
    """Check the installation: versions, extras, speed, numbers.

    A self-test compares a simulation with its solution in closed form. If its numbers are wrong, the exit code is 1.
    """

    prune: Annotated[bool, typer.Option("--prune", help="Empty the cache of compiled code.")] = False
    strict: Annotated[bool, typer.Option("--strict", help="Exit with code 3 if something is wrong.")] = False
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Init:
    """Copy a built-in experiment, or write a first configuration.

    NAME is an experiment, or an example with recorded data (fermentation). With --plant a commented configuration of
    that plant is written, which runs as it is; with --ask it follows from your answers, of your own plant, too.
    """

    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]",
            help="A built-in experiment, see hgorun list experiments, or an example (default: contois_te025).",
            autocompletion=completion.starts,
        ),
    ] = None
    folder: Annotated[
        Path | None, typer.Argument(metavar="[FOLDER]", help="Folder to copy it to (default: here; examples: NAME).")
    ] = None
    plant: Annotated[
        str | None,
        typer.Option(
            "--plant",
            metavar="NAME",
            help="Write a configuration of this plant; see hgorun list plants.",
            autocompletion=completion.plants,
        ),
    ] = None
    observers: Annotated[
        list[str],
        typer.Option(
            "--observer",
            metavar="NAME",
            help="With --plant: an observer that is in it; repeatable.",
            autocompletion=completion.observers,
        ),
    ] = field(default_factory=list)
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="With --plant or --ask: its file (default: PLANT.yaml)."),
    ] = None
    schema: Annotated[
        bool, typer.Option("--schema", help="Write the schema for editors beside it, to go with it to other machines.")
    ] = False
    ask: Annotated[bool, typer.Option("--ask", help="Ask what the configuration should have.")] = False
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing files.")] = False
