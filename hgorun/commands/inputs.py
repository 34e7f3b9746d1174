"""The files that commands are given."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from hgorun.commands.given import refuse_what_is_no_configuration
from hgorun.config.kinds import HDF5, kind_of_file
from hgorun.config.nearest import near_file, nearest
from hgorun.config.reading import read_source
from hgorun.errors import ConfigError
from hgorun.files import RESULT_SUFFIXES
from hgorun.process import say

SUFFIXES = (".yaml", ".yml")


def configuration(path: Path, command: str) -> Path:
    """A configuration for a command: the file, or where there is none of that name, the experiment that hgorun brings.

    As with TeX, a file here with the suffix that the name lacks comes before the one that is brought along.

    Raises
    ------
    ConfigError
        For a result or a recording, which other commands take, and for the name of an experiment with the suffix of a
        file that is not there: it says how to get that.
    """
    if os.path.exists(path):  # of a name that is too long, too, there is none
        refuse_what_is_no_configuration(path, command)
        return path
    from hgorun.reproduce.shipped import experiments

    shipped = experiments()
    name = next((n for n in shipped if str(path.with_suffix("")) in (n, Path(n).name)), None)
    if name is None:
        _refuse_unknown_name(path)
        return path  # whoever reads it says that it is not there
    own = with_suffix(path)
    if own is not None:
        return own
    if path.suffix:
        short = Path(name).name
        raise ConfigError(
            f"there is no such file; `hgorun init {short}` copies the experiment {name}, and without {path.suffix} the "
            "name stands for it",
            file=str(path),
        )
    say(f"hgorun: {path}: no file here; this is the experiment {name}, which `hgorun init {path.name}` copies")
    return shipped[name]


def _refuse_unknown_name(path: Path) -> None:
    """Where neither a file nor an experiment is called so, nor a file alike: what it is, or which name may be meant."""
    refuse_name_of_another_thing(path)
    if path.suffix or near_file(path):
        return
    from hgorun.reproduce.shipped import experiments

    shipped = experiments()
    near = nearest(str(path), [*shipped, *(Path(name).name for name in shipped)])
    raise ConfigError(f"there is no such file.{near} See hgorun list experiments", file=str(path))


def refuse_name_of_another_thing(path: Path) -> None:
    """Where a name that no file has is that of a figure, a claim or something else of ``hgorun list``, say so.

    Raises
    ------
    ConfigError
    """
    if os.path.exists(path):
        return
    from hgorun.commands.other_names import in_its_place

    if known := in_its_place(str(path)):
        raise ConfigError(f"there is no such file.{known}", file=str(path))


def with_suffix(path: Path) -> Path | None:
    """The YAML file that a name without suffix is of, which is said, since an experiment is called so, too."""
    if path.suffix in SUFFIXES:
        return None
    own = next((file for end in SUFFIXES if os.path.isfile(file := path.with_name(path.name + end))), None)
    if own is not None:
        say(f"hgorun: {path}: taking {own}; where there is no such file, the name is that of an experiment of hgorun")
    return own


def own_first(names: Sequence[str], command: str) -> list[str]:
    """Names of figures and experiments, with a file here in the place of an experiment that is called alike.

    Raises
    ------
    ConfigError
        For a file that is no configuration.
    """
    from hgorun.reproduce.shipped import experiments

    known = experiments()
    short = {Path(name).name for name in known}
    for name in names:
        if Path(name).suffix not in SUFFIXES and os.path.isfile(name) and name not in known:
            refuse_what_is_no_configuration(Path(name), command)
            read_source(name)  # which refuses most of what is no YAML
            raise ConfigError(f"{command} takes figures, experiments, and files whose names end in .yaml", file=name)
    return [str((with_suffix(Path(n)) if n in known or n in short else None) or n) for n in names]


def is_result(path: Path) -> bool:
    """Whether a name is that of a result file, or the file is one, whatever it is called."""
    if path.suffix.lower() in RESULT_SUFFIXES:
        return True
    if kind_of_file(path) is not HDF5:
        return False
    from hgorun.result.hdf5.forms import RESULT, SWEEP, form_of  # not for simulate, which has to be quick

    return form_of(path) in (RESULT, SWEEP)


def may_be_ensemble(path: Path) -> bool:
    """Whether a look into it is worth while."""
    return os.path.isdir(path) or is_result(path)
