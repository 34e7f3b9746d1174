"""What a file is that a command cannot take in the place of a configuration, and which command takes it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from hgorun.config.kinds import HDF5, head_of, is_recording, kind_of
from hgorun.errors import ConfigError

_MANIFEST = "manifest.json"  # of the folder in which a sweep is carried out
_SHOWN = "hgorun compare {0} shows it"
_MADE_FROM = f"{{command}} takes a configuration: its own is hgorun.read('{{0}}').config in Python; {_SHOWN}"
_VARIED = f"{{command}} takes a configuration, such as the base of the sweep; {_SHOWN}"
# What somebody may have wanted of it, and how to get that; {0} is its path.
_OF_A_RUN = {
    "simulate": f"hgorun rerun {{0}} makes it again, and {_SHOWN}",
    "estimate": "hgorun estimate CONFIG {0} reads its measurements as a recording",
    "tune": "hgorun tune CONFIG {0} reads its measurements as a recording",
    "sweep": f"sweep takes a file with base and axes; {_SHOWN}",
    "show": _SHOWN,
    "benchmark": f"benchmark takes a file with plants, scenarios and observers; {_SHOWN}",
}
_OF_A_SWEEP = {
    "sweep": f"sweep takes the YAML file that it was made from, and goes on with what is missing; {_SHOWN}",
    "benchmark": _OF_A_RUN["benchmark"],
    "show": _SHOWN,
}
_OF_A_RECORDING = {
    "estimate": "hgorun estimate CONFIG {0} runs observers on it, where CONFIG has the key data; hgorun init "
    "fermentation copies an example",
    "tune": "hgorun tune CONFIG {0} tunes observers on it, where CONFIG has the keys data and tune",
}


def refuse_what_is_no_configuration(path: Path, command: str) -> None:
    """Where a result or a recording stands in the place of a configuration, say what would be right.

    What is none of these is left to whoever reads it.

    Raises
    ------
    ConfigError
    """
    if os.path.isfile(path / _MANIFEST):
        raise _refused(path, command, "the folder of a sweep", _OF_A_SWEEP.get(command, _VARIED))
    head = head_of(path)
    if kind_of(head) is HDF5:
        raise _refused(path, command, *_of_hdf5(path, command))
    if command in _OF_A_RECORDING and is_recording(head, path):
        raise _refused(path, command, "a log, not a configuration", _OF_A_RECORDING[command])


def _refused(path: Path, command: str, what: str, right: str) -> ConfigError:
    said = right.replace("{0}", str(path)).replace("{command}", command)
    return ConfigError(f"this is {what}: {said}", file=str(path))


def _of_hdf5(path: Path, command: str) -> tuple[str, str]:
    """What a file says that it is, for which it is opened, and what would be right."""
    from hgorun.result.hdf5.forms import RESULT, SWEEP, form_of, said_of  # not for simulate, which has to be quick

    form = form_of(path)
    what, reader = said_of(form)
    known: Mapping[str | None, tuple[Mapping[str, str], str]] = {
        RESULT: (_OF_A_RUN, _MADE_FROM),
        SWEEP: (_OF_A_SWEEP, _VARIED),
        None: (_OF_A_RECORDING, reader),
    }
    of_commands, else_ = known.get(form, ({}, reader))
    return what, of_commands.get(command, else_)
