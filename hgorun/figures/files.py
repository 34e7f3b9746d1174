"""Figures as files: whole or not at all, and the same bytes for the same figure."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError, HgorunError
from hgorun.figures.style import DPI, styled
from hgorun.file_mode import FILE_MODE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What of the metadata would change from day to day, or from one version of matplotlib to the next.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
    "svg": {"Creator": None, "Date": None},
}


def save(figure: Figure, path: str | Path, formats: Sequence[str] = ("png", "pdf")) -> list[Path]:
    """Write a figure in several formats.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path
        Without a suffix (a dot in the name is none: ``3.10`` becomes ``3.10.png``). Its folder is made when
        missing.
    formats : sequence of str
        Of png (300 dpi), pdf and svg.

    Returns
    -------
    list of Path
        The files, in the order of the formats.

    Raises
    ------
    ConfigError
        For an unknown format.
    HgorunError
        When a file cannot be written; then none is.
    """
    for suffix in formats:
        if suffix not in _METADATA:
            hint = nearest(suffix, _METADATA)
            raise ConfigError(f"figures are not written as {suffix!r}.{hint} Known: {', '.join(_METADATA)}")
    stem = Path(path)
    targets = [stem.with_name(f"{stem.name}.{suffix}") for suffix in formats]
    parts: list[Path] = []
    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        for suffix in formats:
            handle, name = tempfile.mkstemp(dir=stem.parent, prefix=".figure-", suffix=".part")
            os.close(handle)
            parts.append(Path(name))
            with styled():
                figure.savefig(name, format=suffix, dpi=DPI, metadata=_METADATA[suffix])
            os.chmod(name, FILE_MODE)
        for part, target in zip(parts, targets, strict=True):
            os.replace(part, target)
    except OSError as error:
        raise HgorunError(f"{stem}: cannot be written: {error.strerror or error}") from error
    finally:
        for part in parts:
            part.unlink(missing_ok=True)
    return targets
