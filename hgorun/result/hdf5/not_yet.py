"""What to do with a YAML file that somebody gives in the place of a result: the commands that lead to one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from hgorun.config.kinds import kind_of_file, of_another_command
from hgorun.config.reading import read_source
from hgorun.errors import ConfigError
from hgorun.result.hdf5.forms import RESULT, SWEEP

_SEEDS = 20
_SUFFIXES = (".yaml", ".yml")


def refuse_what_has_not_run(path: Path, wanted: str) -> None:
    """Refuse a YAML file; the message says which commands make a result of it, and show that.

    Parameters
    ----------
    path : Path
    wanted : str
        The form of the file that is read: that of one run, or of a sweep.

    Raises
    ------
    ConfigError
    """
    if path.suffix.lower() not in _SUFFIXES or kind_of_file(path) is not None:
        return
    data = read_source(path)[1].data
    what, steps = _steps(data if isinstance(data, dict) else {}, path, wanted)
    raise ConfigError(f"this is {what}, not a result: {steps}", file=str(path))


def _steps(data: Mapping[str, Any], path: Path, wanted: str) -> tuple[str, str]:
    """What the file is, and what leads from it to what is wanted."""
    file, name = quote(str(path)), path.stem
    show = "hgorun report" if wanted == SWEEP else "hgorun compare"
    runs = data["runs"] if isinstance(data.get("runs"), dict) else {}
    many = [str(run) for run, keys in runs.items() if isinstance(keys, dict) and {"seeds", "vary"} & keys.keys()]
    if (other := of_another_command(data)) is not None:
        command, what, does = other
        result = quote(f"results/{name}.sweep.h5")
        then = {"sweep": f", then `{show} {result}` shows it", "benchmark": ", and writes its tables"}.get(command, "")
        return what, f"`hgorun {command} {file}` {does}{then}"
    if "data" in data:
        result = quote(f"results/{name}.h5")
        return (
            "a configuration of recorded data",
            f"`hgorun estimate {file}` runs its observers, then `hgorun compare {result}` shows the result",
        )
    if not ({"plant", "runs", "extends"} & data.keys()):
        return "YAML without a plant", "`hgorun init` copies a configuration to start from"
    if many and (wanted == SWEEP or len(many) == len(runs)):
        result = quote(f"results/{name}/{many[0]}.sweep.h5")
        shown = f"then `{show} {result}` shows {'the first of them' if many[1:] else 'it'}"
        return "a configuration with ensembles", f"`hgorun sweep {file}` carries out what has seeds or vary, {shown}"
    return "a configuration", _of_one_run(data, [str(run) for run in runs if run not in many], path, wanted)


def _of_one_run(data: Mapping[str, Any], runs: Sequence[str], path: Path, wanted: str) -> str:
    """What a configuration of single runs needs for one of them, or for an ensemble."""
    file, name = quote(str(path)), path.stem
    result = quote(f"results/{name}/{runs[0]}.h5" if runs else f"results/{name}.h5")
    if wanted == RESULT:
        return f"`hgorun simulate {file}` runs it, then `hgorun compare {result}` shows the result"
    if not (data.get("observers") or runs):
        return "a report is of observers, and it has none: name some under the key observers (hgorun list observers)"
    steps, many = steps_to_an_ensemble(path, runs[0] if runs else None)
    return (
        f"a report is of an ensemble, such as {steps}, then `hgorun report {quote(f'results/{many.stem}.sweep.h5')}`; "
        f"`hgorun compare {file}` draws one run"
    )


def steps_to_an_ensemble(path: Path, run: str | None = None) -> tuple[str, Path]:
    """The commands that carry out an ensemble of a configuration or of one of its runs, and the file that it needs."""
    many = path.with_name(f"{path.stem}_many{path.suffix}")
    keys = {"base": path.name, **({} if run is None else {"run": run}), "axes": {"seed": {"count": _SEEDS}}}
    text = yaml.safe_dump(keys, default_flow_style=True, sort_keys=False, allow_unicode=True, width=10_000).strip()
    file = quote(str(many))
    return f"{_SEEDS} seeds: `echo {quote(text)} > {file}`, then `hgorun sweep {file}`", many
