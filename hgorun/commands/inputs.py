"""The files that commands are given."""

from __future__ import annotations

import os
from pathlib import Path

from hgorun.commands.outputs import RESULT_SUFFIXES
from hgorun.errors import ConfigError
from hgorun.process import say


def configuration(path: Path) -> Path:
    """A configuration: the file, or where there is none of that name, the experiment that hgorun brings under it.

    Raises
    ------
    ConfigError
        For the name of an experiment with the suffix of a file that is not there: it says how to get that.
    """
    if os.path.exists(path):  # of a name that is too long, too, there is none
        return path
    from hgorun.reproduce.shipped import experiments

    shipped = experiments()
    name = next((n for n in shipped if str(path.with_suffix("")) in (n, Path(n).name)), None)
    if name is None:
        return path  # whoever reads it says that it is not there
    if path.suffix:
        short = Path(name).name
        raise ConfigError(
            f"there is no such file; `hgorun init {short}` copies the experiment {name}, and without {path.suffix} the "
            "name stands for it",
            file=str(path),
        )
    say(f"hgorun: {path}: no file here; this is the experiment {name}, which `hgorun init {path.name}` copies")
    return shipped[name]


def is_result(path: Path) -> bool:
    """Whether a name is that of a result file."""
    return path.suffix.lower() in RESULT_SUFFIXES


def may_be_ensemble(path: Path) -> bool:
    """Whether a look into it is worth while."""
    return path.is_dir() or is_result(path)
