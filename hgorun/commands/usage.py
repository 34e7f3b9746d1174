"""What is wrong with the words of a command line, said as everything else is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from typer import BadParameter

from hgorun.config.nearest import nearest_name
from hgorun.errors import ConfigError, printable

if TYPE_CHECKING:
    from typer._click.core import Context

UsageError: type[Exception] = BadParameter.__mro__[1]  # click's own class, or that of a typer that comes without click

_ENOUGH = 5  # letters and hyphens of an option that is not written to its end

_VALUES = {"--format": ("csv", "latex"), "--lang": ("c", "latex")}  # that are taken for options


def refused(error: Exception, ctx: Context, all_options: Callable[[], Mapping[str, Sequence[str]]]) -> ConfigError:
    """What a library says of options and arguments, told by the kind of its error; with the options of each command."""
    name, command = getattr(error, "option_name", None), ctx.command
    if name is not None and hasattr(error, "possibilities"):
        return _no_option(str(name), ctx, all_options())
    if name is not None:
        return _wrong_use(str(name), command.params)
    if hasattr(error, "param_type"):
        return ConfigError(f"{_name(getattr(error, 'param', None))} is missing: {usage(ctx)}")
    return ConfigError(printable(str(getattr(error, "message", error))))


def too_many(words: Sequence[str], ctx: Context) -> ConfigError:
    """Words behind all that a command takes."""
    return ConfigError(f"{printable(words[0])} is one word too many: {usage(ctx)}")


def usage(ctx: Context) -> str:
    """A command with what it takes."""
    return " ".join(["hgorun", str(ctx.command.name), *ctx.command.collect_usage_pieces(ctx)[1:]])


def _no_option(name: str, ctx: Context, known: Mapping[str, Sequence[str]]) -> ConfigError:
    command, parent = ctx.command, ctx.parent
    long = name.startswith("--")  # letters are no likelier meant for each other
    own = [*options(command.params), *ctx.help_option_names]
    everywhere = {option for of_one in known.values() for option in of_one}
    hint = "" if name in everywhere else _called_otherwise(name, own, known)
    near = _nearest_option(name, own) if long and not hint and name not in everywhere else ""
    hint = hint or (near and f" Did you mean `{near}`?")
    meant = _nearest_option(name, everywhere) if long else name
    others = _having(meant, known)
    if not hint and others:
        hint = f" {'It' if meant == name else meant} is an option of {others}."
    called = f"hgorun {command.name}" if parent is not None else "hgorun"
    return ConfigError(f"there is no option {printable(name)}.{hint} {called} -h lists the options")


def _having(option: str, known: Mapping[str, Sequence[str]]) -> str:
    """The commands that have an option, as a text; empty where none has it."""
    others = [other for other, of_one in known.items() if option in of_one]
    return " and ".join(filter(None, (", ".join(others[:-1]), *others[-1:])))


def _called_otherwise(name: str, own: Sequence[str], known: Mapping[str, Sequence[str]]) -> str:
    """Of an option that is none in any command: what does the same, or "" where nothing is known to."""
    if name == "--seeds":
        return " hgorun sweep takes many seeds, of a file with `base: CONFIG` and `axes: {seed: {count: 50}}`."
    for option, values in _VALUES.items():
        if option in own and name[2:] in values:
            return f" Did you mean `{option} {name[2:]}`?"
    elsewhere = [(option, _having(option, known)) for option, values in _VALUES.items() if name[2:] in values]
    return "".join(f" `{option} {name[2:]}` is an option of {others}." for option, others in elsewhere if others)


def _nearest_option(name: str, known: Iterable[str]) -> str:
    """The long option that begins so, or is most like it in its letters, of which its hyphens are none; or ""."""
    names = sorted(one[2:] for one in known if one.startswith("--"))
    begun = [one for one in names if one.startswith(name[2:])] if len(name) >= _ENOUGH else []
    found = begun[0] if begun else nearest_name(name[2:], names)
    return found and f"--{found}"


def _wrong_use(name: str, params: Iterable[Any]) -> ConfigError:
    """A switch with a value, or an option without one."""
    option = next(param for param in params if name in (*param.opts, *param.secondary_opts))
    if not option.is_flag:
        return ConfigError(f"{name}: a value is missing: {name} {option.metavar or 'VALUE'}")
    other = next((one for one in (*option.opts, *option.secondary_opts) if one.startswith("--") and one != name), None)
    opposite = f"; {other} is its opposite" if option.secondary_opts else ""
    return ConfigError(f"{name} is a switch, which takes no value{opposite}")


def options(params: Iterable[Any]) -> list[str]:
    """Names of options that begin as given on the command line."""
    return [one for p in params if p.param_type_name == "option" for one in (*p.opts, *p.secondary_opts)]


def _name(param: Any) -> str:
    return str(getattr(param, "metavar", None) or getattr(param, "human_readable_name", "an argument"))
