"""The command line: parse, call, exit. Options are in ``hgorun.commands.run_options``, ``ensemble_options`` and
``catalogue_options``; the commands are beside them.

Only typer is imported here; everything else when a command runs, so that help comes at once.
"""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Sequence
from copy import copy

import typer

from hgorun.commands import catalogue_options, ensemble_options, run_options
from hgorun.commands.command import app, command
from hgorun.commands.mistaken import refuse_what_is_no_command
from hgorun.errors import ConfigError, HgorunError, PluginError, PluginWarning, printable
from hgorun.process import INTERRUPTED, TERMINATED, say, say_ended, silence

__all__ = ["app", "main"]

_NOT_OK = "a status is not ok, with --strict"


@command("simulate", run_options.Simulate, _NOT_OK)
def _simulate(chosen: run_options.Simulate) -> int:
    from hgorun.commands.simulate import simulate

    return simulate(chosen)


@command("estimate", run_options.Estimate, _NOT_OK)
def _estimate(chosen: run_options.Estimate) -> int:
    from hgorun.commands.estimate import estimate

    return estimate(chosen)


@command("sweep", ensemble_options.Sweep, _NOT_OK)
def _sweep(chosen: ensemble_options.Sweep) -> int:
    from hgorun.commands.sweep import sweep

    return sweep(chosen)


@command("merge", ensemble_options.Merge, _NOT_OK)
def _merge(chosen: ensemble_options.Merge) -> int:
    from hgorun.commands.sweep import merge

    return merge(chosen)


@command("rerun", run_options.Rerun, "a number differs, with --check")
def _rerun(chosen: run_options.Rerun) -> int:
    from hgorun.commands.rerun import rerun

    return rerun(chosen)


@command("compare", ensemble_options.Compare, _NOT_OK)
def _compare(chosen: ensemble_options.Compare) -> int:
    from hgorun.commands.compare import compare

    return compare(chosen)


@command("report", ensemble_options.Report)
def _report(chosen: ensemble_options.Report) -> int:
    from hgorun.commands.ensembles import report

    return report(chosen)


@command("explore", run_options.Explore)
def _explore(chosen: run_options.Explore) -> int:
    from hgorun.commands.explore import explore

    return explore(chosen)


@command("tune", ensemble_options.Tune)
def _tune(chosen: ensemble_options.Tune) -> int:
    from hgorun.commands.tune import tune

    return tune(chosen)


@command("benchmark", ensemble_options.Bench)
def _benchmark(chosen: ensemble_options.Bench) -> int:
    from hgorun.commands.benchmark import benchmark

    return benchmark(chosen)


@command("export", run_options.Export)
def _export(chosen: run_options.Export) -> int:
    from hgorun.commands.export import export

    return export(chosen)


@command("analyze", run_options.Analyze)
def _analyze(chosen: run_options.Analyze) -> int:
    from hgorun.commands.analyze import analyze

    return analyze(chosen)


@command("cite", run_options.Cite)
def _cite(chosen: run_options.Cite) -> int:
    from hgorun.commands.cite import cite

    return cite(chosen)


@command("figures", catalogue_options.Figures)
def _figures(chosen: catalogue_options.Figures) -> int:
    from hgorun.commands.figures import figures

    return figures(chosen)


@command("claims", catalogue_options.Claims, "a verdict is not as expected, with --strict")
def _claims(chosen: catalogue_options.Claims) -> int:
    from hgorun.commands.claims import claims

    return claims(chosen)


@command("list", catalogue_options.List)
def _list(chosen: catalogue_options.List) -> int:
    from hgorun.commands.catalogue import list_all

    return list_all(chosen)


@command("show", catalogue_options.Show)
def _show(chosen: catalogue_options.Show) -> int:
    from hgorun.commands.catalogue import show

    return show(chosen)


@command("schema", catalogue_options.Schema)
def _schema(chosen: catalogue_options.Schema) -> int:
    from hgorun.commands.schema import schema

    return schema(chosen)


@command("doctor", catalogue_options.Doctor, "something is wrong, with --strict")
def _doctor(chosen: catalogue_options.Doctor) -> int:
    from hgorun.commands.doctor import doctor

    return doctor(chosen)


@command("init", catalogue_options.Init)
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
        for one in (error, *(error.others if isinstance(error, ConfigError) else ())):
            say(f"hgorun: {one}")
        sys.exit(error.exit_code)
    except SystemExit as stop:
        if stop.code in (INTERRUPTED, TERMINATED):  # the first is typer's exit code for Ctrl-C
            say_ended(stop.code)
        raise
    except KeyboardInterrupt:
        say_ended(INTERRUPTED)
        sys.exit(INTERRUPTED)
    except OSError as error:
        silence(sys.stdout)
        if error.errno is None:  # not the system's, but of a library's loader
            why = "too little memory, or a broken installation"
            say(f"hgorun: a library cannot be loaded: {why}: {printable(str(error))}")
            sys.exit(1)
        if error.filename is not None:  # one that was to be opened, and not an output that ended
            say(f"hgorun: {printable(str(error.filename))}: {printable(str(error.strerror))}")
            sys.exit(ConfigError.exit_code)
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


def _show_warnings() -> None:
    """Warnings that are for the user are said as one line; those of libraries are not shown."""

    def show(message: Warning | str, category: type[Warning], *where: object, **more: object) -> None:
        if issubclass(category, PluginWarning):
            say(f"hgorun: {printable(str(message))}")

    warnings.simplefilter("always", PluginWarning)
    warnings.showwarning = show
    logging.getLogger("matplotlib").addFilter(_matters)


def _matters(record: logging.LogRecord) -> bool:
    """Where the home cannot be written, matplotlib takes a temporary folder, which is of no matter here."""
    return record.funcName != "_get_config_or_cache_dir"


if __name__ == "__main__":
    main()
