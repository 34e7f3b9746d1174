"""The command line: parse, call, print. What the commands do is in ``hgorun.commands``.

Only typer is imported here; everything else when a command runs, so that help comes at once.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

from hgorun.errors import HgorunError

_INTERRUPTED = 130

app = typer.Typer(
    name="hgorun",
    help="The bench for high-gain observers: simulate, compare and check them from one YAML file.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Configs = Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="YAML configurations.")]
Output = Annotated[
    Optional[Path], typer.Option("-o", "--output", help="File or folder to write to (default: results).")  # noqa: UP045
]
Overrides = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option("--set", metavar="PATH=VALUE", help="Change a key, e.g. observers.SHGO.theta=2; repeatable."),
]
Seed = Annotated[Optional[int], typer.Option("--seed", min=0, help="In place of the file's seed.")]  # noqa: UP045
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON on stdout, and nothing else there.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit code 3 when an observer diverged.")]
RunName = Annotated[Optional[str], typer.Option("--run", help="One of the file's runs (default: all).")]  # noqa: UP045
Jobs = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--jobs", min=1, help="Processes at once (default: one a processor)."),
]
CheckStep = Annotated[bool, typer.Option("--check-step", help="Run again with half the step; report the difference.")]


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from hgorun.version import __version__

        typer.echo(__version__)
        raise typer.Exit()


@app.command()
def simulate(
    configs: Configs,
    output: Output = None,
    overrides: Overrides = None,
    seed: Seed = None,
    quiet: Quiet = False,
    json: Json = False,
    strict: Strict = False,
    check_step: CheckStep = False,
    run: RunName = None,
) -> None:
    """Run configurations, write results/NAME.h5, print the metrics."""
    from hgorun.commands.run import simulate

    raise typer.Exit(
        simulate(
            configs,
            output,
            overrides or [],
            seed,
            quiet=quiet,
            json=json,
            strict=strict,
            check_step=check_step,
            run=run,
        )
    )


@app.command()
def compare(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Configurations or result files.")],
    output: Output = None,
    overrides: Overrides = None,
    seed: Seed = None,
    quiet: Quiet = False,
    json: Json = False,
    format: Annotated[str, typer.Option("--format", help="Of the table: text, csv or latex.")] = "text",
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw comparison plots (PNG and PDF).")] = True,
    strict: Strict = False,
    run: RunName = None,
    analyze: Annotated[bool, typer.Option("--analyze", help="Add what theory predicts for configurations.")] = False,
) -> None:
    """Metrics side by side, and comparison plots."""
    from hgorun.commands.run import compare

    raise typer.Exit(
        compare(
            sources,
            output,
            overrides or [],
            seed,
            quiet=quiet,
            json=json,
            style=format,
            plots=plots,
            strict=strict,
            run=run,
            analyze=analyze,
        )
    )


Names = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Argument(metavar="[NAME...]", help="Figures, experiments or folders of them, or YAML files."),
]


@app.command()
def analyze(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="A YAML configuration.")],
    output: Output = None,
    overrides: Overrides = None,
    seed: Seed = None,
    quiet: Quiet = False,
    json: Json = False,
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw errors and their bounds (PNG, PDF).")] = True,
    search: Annotated[bool, typer.Option("--search", help="Find the smallest theta that works, by trying.")] = False,
    run: RunName = None,
) -> None:
    """Gains, bounds and predicted noise: theory beside simulation."""
    from hgorun.commands.analyze import analyze

    raise typer.Exit(
        analyze(config, output, overrides or [], seed, quiet=quiet, json=json, plots=plots, search=search, run_name=run)
    )


@app.command()
def figures(
    names: Names = None,
    output: Output = None,
    quiet: Quiet = False,
    json: Json = False,
    jobs: Jobs = None,
    report: Annotated[bool, typer.Option("--report", help="Measure the claims too, and write REPORT.md.")] = False,
) -> None:
    """Draw the figures of the publications (PNG and PDF); only those that changed since."""
    from hgorun.commands.figures import figures

    raise typer.Exit(figures(names or [], output, quiet=quiet, json=json, workers=jobs, report=report))


@app.command()
def claims(
    names: Names = None,
    output: Output = None,
    quiet: Quiet = False,
    json: Json = False,
    jobs: Jobs = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 3 when a verdict is not the expected one.")
    ] = False,
) -> None:
    """Measure what the publications claim: confirmed or refuted, with the number."""
    from hgorun.commands.claims import claims

    raise typer.Exit(claims(names or [], output, quiet=quiet, json=json, workers=jobs, strict=strict))


@app.command("list")
def list_(
    kind: Annotated[str, typer.Argument(help="plants, observers, experiments or all.")] = "all",
    json: Json = False,
) -> None:
    """What there is: plants, observers, experiments."""
    from hgorun.commands.catalogue import list_all

    raise typer.Exit(list_all(kind, json=json))


@app.command()
def show(name: Annotated[str, typer.Argument(help="A plant, observer or experiment.")], json: Json = False) -> None:
    """Equations, parameters with ranges and defaults, source."""
    from hgorun.commands.catalogue import show

    raise typer.Exit(show(name, json=json))


@app.command()
def schema() -> None:
    """Print the JSON schema of configurations, for editors."""
    from hgorun.commands.catalogue import schema

    raise typer.Exit(schema())


@app.command()
def init(
    name: Annotated[str, typer.Argument(help="A shipped experiment; see hgorun list experiments.")] = "contois_te025",
    folder: Annotated[Path, typer.Argument(help="Where to copy it to.")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that exist.")] = False,
) -> None:
    """Copy a shipped experiment, as a start for one's own."""
    from hgorun.commands.catalogue import init

    raise typer.Exit(init(name, folder, force=force))


def main() -> None:
    """Entry point: errors become one message and an exit code."""
    try:
        app()
    except HgorunError as error:
        print(f"hgorun: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except SystemExit as stop:
        if stop.code == _INTERRUPTED:  # typer's exit code for Ctrl-C
            print("hgorun: interrupted; nothing was left half-written", file=sys.stderr)
        raise
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()  # whoever read our output has left
        sys.exit(141)
    except MemoryError:
        print(
            "hgorun: out of memory; a longer time.output_step, fewer samples (sampling), longer holds of noise, "
            "shorter continuous delays (or a longer solver.step with them) or fewer observers need less",
            file=sys.stderr,
        )
        sys.exit(1)


if __name__ == "__main__":
    main()
