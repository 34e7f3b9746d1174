"""Figures as files: whole or not at all, and the same bytes for the same figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.config.expressions import nearest
from hgorun.config.types import describe
from hgorun.errors import ConfigError
from hgorun.figures.style import DPI, NEARLY_GREY, styled
from hgorun.files import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image

Floats = NDArray[np.float64]
Writer = Callable[[Path], None]

# A small PNG has the first of these resolutions and numbers of colours with which it is small enough.
_SMALL, _SMALL_BYTES = ((90, 64), (90, 32), (90, 16), (75, 16), (60, 16)), 40_000
_GREYS = 6  # of a small PNG, black and white among them
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
        _require_format(suffix)
    stem = Path(path)

    def writer(suffix: str) -> Writer:
        return lambda part: figure.savefig(part, format=suffix, dpi=DPI, metadata=_METADATA[suffix])

    return _write({stem.with_name(f"{stem.name}.{suffix}"): writer(suffix) for suffix in formats})


def named(path: str | Path) -> tuple[Path, str]:
    """The name of a file without its suffix, and the format that the suffix says; png without one.

    Raises
    ------
    ConfigError
        Where this is no name of a file of figures.
    """
    if not isinstance(path, str | PathLike) or not Path(path).name:
        raise ConfigError(f"plot: expected the name of a file .pdf, .png or .svg, found {describe(path)}")
    file = Path(path)
    suffix = file.suffix.lstrip(".") or "png"
    _require_format(suffix)
    return file.with_suffix(""), suffix


def _require_format(suffix: str) -> None:
    if suffix not in _METADATA:
        hint = nearest(suffix, _METADATA)
        raise ConfigError(f"figures are not written as {suffix!r}.{hint} Known: {', '.join(_METADATA)}")


def thumbnail(figure: Figure, path: str | Path) -> Path:
    """Write a figure as a small PNG for reports that are kept under version control.

    90 dpi in 64 colours; fewer colours, then fewer dots, where it would have more than 40 kB. Among the colours are
    those of its lines, however few the points of one are.

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

        drawn: dict[int, Image.Image] = {}
        own = _colours(figure)
        for dpi, colours in _SMALL:
            if dpi not in drawn:
                pixels = io.BytesIO()
                figure.savefig(pixels, format="png", dpi=dpi, metadata=_METADATA["png"])
                with Image.open(pixels) as image:
                    drawn[dpi] = image.convert("RGB")
            reduced(drawn[dpi], own, colours).save(part, format="PNG", optimize=True)
            if part.stat().st_size <= _SMALL_BYTES:
                break

    return _write({Path(path): write})[0]


def _colours(figure: Figure) -> list[Floats]:
    """Those of lines, without greys: red, green and blue from 0 to 1."""
    from matplotlib.colors import to_rgb
    from matplotlib.lines import Line2D

    found = {to_rgb(line.get_color()) for line in figure.findobj(Line2D)}
    return [np.array(one) for one in sorted(found) if max(one) - min(one) > NEARLY_GREY]


def reduced(image: Image.Image, own: Sequence[Floats], count: int) -> Image.Image:
    """An image in so many colours: greys, and its own ones with equally many tints of each.

    The usual choice of colours goes by how many points have them, and would draw a thin line in another one's colour.
    """
    from PIL import Image

    tints = (count - _GREYS) // max(len(own), 1)
    if not own or not tints:
        return image.quantize(count, dither=Image.Dither.NONE)
    mixed = [1 - (1 - one) * (k + 1) / tints for one in own for k in range(tints)]
    palette = np.rint(255 * np.array([*np.linspace(0, 1, _GREYS)[:, None] * np.ones(3), *mixed])).astype(np.uint8)
    points = np.asarray(image, dtype=np.int64)
    packed = points[..., 0] << 16 | points[..., 1] << 8 | points[..., 2]
    seen, places = np.unique(packed, return_inverse=True)
    apart = np.stack([seen >> 16, seen >> 8 & 255, seen & 255], axis=1)[:, None] - palette.astype(np.int64)
    nearest_one = np.argmin((apart**2).sum(axis=2), axis=1).astype(np.uint8)
    found = Image.fromarray(nearest_one[places].reshape(packed.shape))
    found.putpalette(palette.tobytes())
    return found


def _write(writers: Mapping[Path, Writer]) -> list[Path]:
    """All files or none."""
    with ExitStack() as files:
        for path, write in writers.items():
            part = files.enter_context(written_whole(path))
            with styled():
                write(part)
    return list(writers)
