"""Figures as files: whole or not at all, and the same bytes for the same figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError
from hgorun.figures.style import DPI, styled
from hgorun.files import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Writer = Callable[[Path], None]

_SMALL_DPI, _SMALL_COLOURS, _SMALL_BYTES = 90, (64, 32, 16), 40_000
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

    def writer(suffix: str) -> Writer:
        return lambda part: figure.savefig(part, format=suffix, dpi=DPI, metadata=_METADATA[suffix])

    return _write({stem.with_name(f"{stem.name}.{suffix}"): writer(suffix) for suffix in formats})


def thumbnail(figure: Figure, path: str | Path) -> Path:
    """Write a figure as a small PNG for reports that are kept under version control.

    90 dpi in 64 colours; in 32 or 16 where it would have more than 40 kB.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path
        The file, with its suffix. Its folder is made when missing.

    Raises
    ------
    HgorunError
        When it cannot be written; then there is nothing.
    """

    def write(part: Path) -> None:
        from PIL import Image

        pixels = io.BytesIO()
        figure.savefig(pixels, format="png", dpi=_SMALL_DPI, metadata=_METADATA["png"])
        with Image.open(pixels) as opened:
            image = opened.convert("RGB")
        for colours in _SMALL_COLOURS:
            image.quantize(colours, dither=Image.Dither.NONE).save(part, format="PNG", optimize=True)
            if part.stat().st_size <= _SMALL_BYTES:
                break

    return _write({Path(path): write})[0]


def _write(writers: Mapping[Path, Writer]) -> list[Path]:
    """All files or none."""
    with ExitStack() as files:
        for path, write in writers.items():
            part = files.enter_context(written_whole(path))
            with styled():
                write(part)
    return list(writers)
