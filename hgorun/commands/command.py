"""The program of the command line, and how a record of options becomes one of its commands."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import MISSING, Field, fields
from inspect import Parameter, Signature, getdoc
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from hgorun.commands import usage
from hgorun.originals import kept_as_they_are
from hgorun.process import CLOSED_PIPE, silence

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from typer._click.core import Context  # click's own class, in versions of typer that come without it
    from typer._click.formatting import HelpFormatter

    Options = TypeVar("Options", bound=DataclassInstance)

_TYPE = re.compile(r" <[^>]*>$")


class _Group(TyperGroup):
    """The command line as a whole; what is wrong with its words is said as everything else is."""

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        if not args:
            return super().parse_args(ctx, args)  # which shows the help
        try:
            return super().parse_args(ctx, args)
        except usage.UsageError as error:
            raise usage.refused(error, ctx, options_of_all) from None


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
def _alone(
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
            raise usage.refused(error, ctx, options_of_all) from None
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


def command(name: str, record: type[Options], third: str = "") -> Callable[[Callable[[Options], int]], None]:
    """Make a command of a function: the record's fields are its parameters, its docstring the help.

    ``third`` says when its exit code is 3.
    """
    codes = ["0 done", "1 could not finish", "2 wrong input", *([f"3 {third}"] if third else []), "130 interrupted"]

    def add(function: Callable[[Options], int]) -> None:
        def run(**values: object) -> None:
            given = {name: value for name, value in values.items() if value is not None}
            try:
                with kept_as_they_are():
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


def options_of_all() -> dict[str, list[str]]:
    """Of every command."""
    group = typer.main.get_command(app)
    return {name: usage.options(command.params) for name, command in getattr(group, "commands", {}).items()}
