"""The command line: parse, call, exit. Options are in ``hgorun.commands.options``, ``ensemble_options`` and
``catalogue_options``; the commands are beside them.

Only typer is imported here; everything else when a command runs, so that help comes at once.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import MISSING, Field, fields
from inspect import Parameter, Signature, getdoc
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from hgorun.commands import catalogue_options, ensemble_options, options, usage
from hgorun.commands.mistaken import refuse_what_is_no_command
from hgorun.errors import HgorunError, PluginError, PluginWarning, printable
from hgorun.process import CLOSED_PIPE, INTERRUPTED, INTERRUPTION_SAID, TERMINATED, TERMINATION_SAID, say, silence

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from typer._click.core import Context  # click's own class, in versions of typer that come without it
    from typer._click.formatting import HelpFormatter

    Options = TypeVar("Options", bound=DataclassInstance)

_TYPE = re.compile(r" <[^>]*>$")
_NOT_OK = "a status is not ok, with --strict"


class _Group(TyperGroup):
    """The command line as a whole; what is wrong with its words is said as everything else is."""

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        if not args:
            return super().parse_args(ctx, args)  # which shows the help
        try:
            return super().parse_args(ctx, args)
        except usage.UsageError as error:
            raise usage.refused(error, ctx, _options_of_all) from None


app = typer.Typer(
    name="hgorun",
    cls=_Group,
    help="A test bench for high-gain observers: simulate, compare and check them from one YAML file.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done; 1 could not finish; 2 wrong input; 3 a number, status or verdict is not as it should "
    "be, with --strict or --check; 130 interrupted (Ctrl-C). hgorun COMMAND -h says what a command takes.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from hgorun.version import __version__

        typer.echo(__version__)
        raise typer.Exit()


class _Command(TyperCommand):
    """A command whose help has the names of what it takes alone: the types of newer versions of typer are Python's."""

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        if ctx.resilient_parsing:  # as Tab is pressed
            return super().parse_args(ctx, args)
        ctx.allow_extra_args = True
        try:
            rest = super().parse_args(ctx, args)
        except usage.UsageError as error:
            raise usage.refused(error, ctx, _options_of_all) from None
        if rest:
            raise usage.too_many(rest, ctx)
        return rest

    def collect_usage_pieces(self, ctx: Context) -> list[str]:
        arguments = (param for param in self.get_params(ctx) if param.param_type_name == "argument")
        return ["[OPTIONS]", *(param.metavar or param.name or "" for param in arguments)]

    def format_options(self, ctx: Context, formatter: HelpFormatter) -> None:
        sections: dict[str, list[tuple[str, str]]] = {"argument": [], "option": []}
        for param in self.get_params(ctx):
            if (record := param.get_help_record(ctx)) is not None:
                sections[param.param_type_name].append((_TYPE.sub("", record[0]), record[1]))
        for kind, rows in sections.items():
            if rows:
                with formatter.section(f"{kind.capitalize()}s"):
                    formatter.write_dl(rows)


def _command(name: str, record: type[Options], third: str = "") -> Callable[[Callable[[Options], int]], None]:
    """Make a command of a function: the record's fields are its parameters, its docstring the help.

    ``third`` says when its exit code is 3.
    """
    codes = ["0 done", "1 could not finish", "2 wrong input", *([f"3 {third}"] if third else []), "130 interrupted"]

    def add(function: Callable[[Options], int]) -> None:
        def run(**values: object) -> None:
            given = {name: value for name, value in values.items() if value is not None}
            try:
                code = function(record(**given))
                sys.stdout.flush()
            except BrokenPipeError:  # whoever read our output has left; click would make an error of it
                silence(sys.stdout)
                raise typer.Exit(CLOSED_PIPE) from None
            raise typer.Exit(code)

        parameters = [
            Parameter(f.name, Parameter.KEYWORD_ONLY, default=_default(f), annotation=f.type) for f in fields(record)
        ]
        run.__dict__["__signature__"] = Signature(parameters)  # what typer reads
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        app.command(name, cls=_Command, help=getdoc(record), epilog=f"Exit codes: {'; '.join(codes)}.")(run)

    return add


def _default(field: Field[Any]) -> object:
    if field.default_factory is not MISSING:
        return None  # not a list: click 8.1 refuses one for an argument that takes several values
    return Parameter.empty if field.default is MISSING else field.default


@_command("simulate", options.Simulate, _NOT_OK)
def _simulate(chosen: options.Simulate) -> int:
    from hgorun.commands.simulate import simulate

    return simulate(chosen)


@_command("estimate", options.Estimate, _NOT_OK)
def _estimate(chosen: options.Estimate) -> int:
    from hgorun.commands.estimate import estimate

    return estimate(chosen)


@_command("sweep", ensemble_options.Sweep, _NOT_OK)
def _sweep(chosen: ensemble_options.Sweep) -> int:
    from hgorun.commands.sweep import sweep

    return sweep(chosen)


@_command("merge", ensemble_options.Merge, _NOT_OK)
def _merge(chosen: ensemble_options.Merge) -> int:
    from hgorun.commands.sweep import merge

    return merge(chosen)


@_command("rerun", options.Rerun, "a number differs, with --check")
def _rerun(chosen: options.Rerun) -> int:
    from hgorun.commands.rerun import rerun

    return rerun(chosen)


@_command("compare", ensemble_options.Compare, _NOT_OK)
def _compare(chosen: ensemble_options.Compare) -> int:
    from hgorun.commands.compare import compare

    return compare(chosen)


@_command("report", ensemble_options.Report)
def _report(chosen: ensemble_options.Report) -> int:
    from hgorun.commands.ensembles import report

    return report(chosen)


@_command("explore", options.Explore)
def _explore(chosen: options.Explore) -> int:
    from hgorun.commands.explore import explore

    return explore(chosen)


@_command("tune", ensemble_options.Tune)
def _tune(chosen: ensemble_options.Tune) -> int:
    from hgorun.commands.tune import tune

    return tune(chosen)


@_command("benchmark", ensemble_options.Bench)
def _benchmark(chosen: ensemble_options.Bench) -> int:
    from hgorun.commands.benchmark import benchmark

    return benchmark(chosen)


@_command("export", options.Export)
def _export(chosen: options.Export) -> int:
    from hgorun.commands.export import export

    return export(chosen)


@_command("analyze", options.Analyze)
def _analyze(chosen: options.Analyze) -> int:
    from hgorun.commands.analyze import analyze

    return analyze(chosen)


@_command("cite", options.Cite)
def _cite(chosen: options.Cite) -> int:
    from hgorun.commands.cite import cite

    return cite(chosen)


@_command("figures", catalogue_options.Figures)
def _figures(chosen: catalogue_options.Figures) -> int:
    from hgorun.commands.figures import figures

    return figures(chosen)


@_command("claims", catalogue_options.Claims, "a verdict is not as expected, with --strict")
def _claims(chosen: catalogue_options.Claims) -> int:
    from hgorun.commands.claims import claims

    return claims(chosen)


@_command("list", catalogue_options.List)
def _list(chosen: catalogue_options.List) -> int:
    from hgorun.commands.catalogue import list_all

    return list_all(chosen)


@_command("show", catalogue_options.Show)
def _show(chosen: catalogue_options.Show) -> int:
    from hgorun.commands.catalogue import show

    return show(chosen)


@_command("schema", catalogue_options.Schema)
def _schema(chosen: catalogue_options.Schema) -> int:
    from hgorun.commands.schema import schema

    return schema(chosen)


@_command("doctor", catalogue_options.Doctor, "something is wrong, with --strict")
def _doctor(chosen: catalogue_options.Doctor) -> int:
    from hgorun.commands.doctor import doctor

    return doctor(chosen)


@_command("init", catalogue_options.Init)
def _init(chosen: catalogue_options.Init) -> int:
    from hgorun.commands.init import init

    return init(chosen)


def main() -> None:
    """Entry point: errors become one message and an exit code."""
    _show_warnings()
    os.environ["MPLBACKEND"] = "agg"  # figures are files; a notebook's setting may name what is not installed here
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"  # looking for them takes longer than checking a configuration
    try:
        refuse_what_is_no_command(sys.argv[1:], [str(one.name) for one in app.registered_commands])
        _called(sys.argv[1:])()
    except HgorunError as error:
        say(f"hgorun: {error}")
        sys.exit(error.exit_code)
    except SystemExit as stop:
        if stop.code == INTERRUPTED:  # typer's exit code for Ctrl-C
            say(INTERRUPTION_SAID)
        elif stop.code == TERMINATED:
            say(TERMINATION_SAID)
        raise
    except KeyboardInterrupt:
        say(INTERRUPTION_SAID)
        sys.exit(INTERRUPTED)
    except OSError as error:
        silence(sys.stdout)
        if error.errno is None:  # not the system's, but of a library's loader
            why = "too little memory, or a broken installation"
            say(f"hgorun: a library cannot be loaded: {why}: {printable(str(error))}")
            sys.exit(1)
        say(f"hgorun: {printable(str(error.strerror or error))}: the output is incomplete")
        sys.exit(1)
    except MemoryError:
        say(
            "hgorun: out of memory; a longer time.output_step, fewer samples (sampling), longer holds of noise, "
            "shorter continuous delays (or a longer solver.step with them) or fewer observers need less"
        )
        sys.exit(1)
    except Exception as error:
        from hgorun.registry import foreign_code

        where = foreign_code(error)
        if where is None:
            raise  # a fault of ours, which its traceback shows
        say(f"hgorun: {where} raised {type(error).__name__}: {printable(str(error))}")
        sys.exit(PluginError.exit_code)


def _called(words: Sequence[str]) -> typer.Typer:
    """The program with the one command that is called, if one is: typer reads all options of those that it is given."""
    commands = [command for command in app.registered_commands if words and command.name == words[0]]
    if not commands:
        return app
    one = copy(app)
    one.registered_commands = commands
    return one


def _options_of_all() -> dict[str, list[str]]:
    """Of every command."""
    group = typer.main.get_command(app)
    return {name: usage.options(command.params) for name, command in getattr(group, "commands", {}).items()}


def _show_warnings() -> None:
    """Warnings that are for the user are said as one line; those of libraries are not shown."""

    def show(message: Warning | str, category: type[Warning], *where: object, **more: object) -> None:
        if issubclass(category, PluginWarning):
            say(f"hgorun: {printable(str(message))}")

    warnings.simplefilter("always", PluginWarning)
    warnings.showwarning = show


if __name__ == "__main__":
    main()
