"""Options that several commands have, written once: the command line makes its parameters and its help from them.

Those of each command are in ``run_options``, ``ensemble_options`` and ``catalogue_options``. Only typer is loaded with
it, so that help appears at once; annotations are evaluated, since the command line reads them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from hgorun.commands import completion
from hgorun.commands.numbers import whole

Strict = Annotated[bool, typer.Option("--strict", help="Exit with code 3 if a status is not ok.")]
"""Of commands that find out whether all went well."""

Seed = Annotated[
    int | None,
    typer.Option("--seed", parser=whole("--seed", 0), metavar="INTEGER", help="Override the seed in the file."),
]
"""Of commands that read a configuration."""

Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Change a key, e.g. observers.SHGO.theta=2; repeatable.",
        autocompletion=completion.keys,
    ),
]
"""Of commands in whose configuration keys may be changed."""

OneConfig = Annotated[
    Path,
    typer.Argument(
        metavar="CONFIG",
        help="A YAML configuration, or the name of a built-in experiment.",
        autocompletion=completion.configurations,
    ),
]
"""Of commands that read one configuration."""

OnlyRun = Annotated[
    str | None,
    typer.Option(
        "--run", metavar="NAME", help="Only this run of the file (default: all).", autocompletion=completion.runs
    ),
]
"""Of commands that carry out the runs of a configuration."""

WhichRun = Annotated[
    str | None,
    typer.Option(
        "--run", metavar="NAME", help="Which run of the file, where it has several.", autocompletion=completion.runs
    ),
]
"""Of commands that take one run."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Printing:
    """What is printed, and where files go."""

    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PATH", help="File or folder to write to (default: results)."),
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

    overrides: Overrides = field(default_factory=list)
    seed: Seed = None
    run: OnlyRun = None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Drawing:
    """How figures are drawn."""

    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw figures (PNG and PDF).")] = True
    width: Annotated[
        str,
        typer.Option(
            "--width",
            metavar="COLUMNS",
            help="Width of figures: one or two columns of a journal.",
            autocompletion=completion.one_of("one", "two"),
        ),
    ] = "two"
    style: Annotated[
        str,
        typer.Option(
            "--style",
            metavar="STYLE",
            help="Page that figures are for: light or dark.",
            autocompletion=completion.one_of("light", "dark"),
        ),
    ] = "light"
