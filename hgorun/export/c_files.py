"""The files of an observer in C."""

from __future__ import annotations

from collections.abc import Mapping

from hgorun.export.c_code import Real
from hgorun.export.c_header import header, top
from hgorun.export.c_source import Source
from hgorun.export.observer import Exported


def c_files(observer: Exported, *, single: bool = False) -> Mapping[str, str]:
    """Name and text of the source and of its header.

    Parameters
    ----------
    observer : Exported
    single : bool
        Numbers of type ``float``; times stay ``double``, since a float has no digits for a clock.
    """
    source = Source(observer, Real(single))
    return {f"{observer.name}.c": top(source) + source.text(), f"{observer.name}.h": header(source)}
