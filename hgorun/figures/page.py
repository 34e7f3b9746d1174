"""The page that a figure is for: one column or two, light or dark."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hgorun.config.nearest import refuse_other
from hgorun.config.study import WIDTHS
from hgorun.config.study import Figure as FigureBlock
from hgorun.figures.style import GRID, NEARLY_GREY, luminance

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

STYLES = ("light", "dark")
TWO = WIDTHS["two"]
NARROW = 5.0  # inches: below it, panels stand one below the other
_PAPER, _INK = "#16181d", "#f2f2f2"  # of a dark page
AS_IT_IS = "on a colour that every page has"  # what has it as its gid keeps its colour


@dataclass(frozen=True)
class Page:
    """What a figure is drawn for.

    Attributes
    ----------
    width : float
        Inches.
    style : {"light", "dark"}
    """

    width: float = TWO
    style: str = "light"

    @classmethod
    def changed(cls, width: str | None, style: str | None) -> Callable[[FigureBlock], FigureBlock]:
        """A figure's block as the command line wants it; on a narrow page its panels stand one below the other.

        Raises
        ------
        ConfigError
            For names that there are not.
        """
        page = cls.named(width or "two", style or "light")
        change: dict[str, object] = {} if style is None else {"style": page.style}
        if width is not None:
            change["width"] = page.width
        if width is not None and page.width < NARROW:
            change |= {"columns": 1, "height": None}
        return lambda block: block.model_copy(update=change)

    @classmethod
    def named(cls, width: str, style: str) -> Page:
        """A page as the command line calls it.

        Raises
        ------
        ConfigError
            For names that there are not.
        """
        refuse_other("--width", width, WIDTHS)
        refuse_other("--style", style, STYLES)
        return cls(WIDTHS[width], style)


LIGHT = Page()


def on_page(figure: Figure, style: str) -> Figure:
    """The figure for a page of this style: on a dark one greys are reversed, and colours that are too dark are lighter.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Finished; it is changed in place.
    style : {"light", "dark"}
    """
    if style == "dark":
        for artist in figure.findobj(lambda one: one.get_gid() != AS_IT_IS):
            _darken(artist)
        figure.set_facecolor(_PAPER)
        for ax in figure.findobj(lambda one: hasattr(one, "tick_params")):
            colours = {"color": _INK, "labelcolor": _INK, "grid_color": dark(GRID)}
            ax.tick_params(which="both", **colours)  # type: ignore[attr-defined]  # found by it
    return figure


def dark(colour: object) -> tuple[float, float, float, float]:
    """What stands for a colour on a dark page.

    Parameters
    ----------
    colour
        Whatever matplotlib takes for one.

    Returns
    -------
    tuple of float
        Red, green, blue and alpha. White becomes the page and black the ink; between them greys are reversed. Other
        colours are mixed with white until their luminance is at least that of a medium grey.
    """
    from matplotlib.colors import to_rgba

    red, green, blue, alpha = to_rgba(colour)  # type: ignore[arg-type]  # of matplotlib's own types
    paper, ink = to_rgba(_PAPER)[:3], to_rgba(_INK)[:3]
    if max(red, green, blue) - min(red, green, blue) <= NEARLY_GREY:
        grey = (red + green + blue) / 3
        red, green, blue = (i + (p - i) * grey for p, i in zip(paper, ink, strict=True))
        return red, green, blue, alpha
    light = luminance(red, green, blue)
    white = max(0.0, (0.3 - light) / (1.0 - light))
    red, green, blue = ((part**2.2 * (1 - white) + white) ** (1 / 2.2) for part in (red, green, blue))
    return red, green, blue, alpha


def seen_on(colour: object) -> str:
    """White or black, whichever has the larger contrast with a colour."""
    from matplotlib.colors import to_rgb

    light = luminance(*to_rgb(colour))  # type: ignore[arg-type]  # of matplotlib's own types
    return "white" if 1.05 / (light + 0.05) > (light + 0.05) / 0.05 else "black"


def _shown(colour: Any) -> Any:
    """The same, but none stays none."""
    from matplotlib.colors import to_rgba

    return "none" if to_rgba(colour)[3] == 0 else dark(colour)


def _darken(artist: Artist) -> None:
    """Change the colours of one artist."""
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.text import Text

    from hgorun.figures.cut_marks import halo

    if isinstance(artist, Line2D):
        edge, face = artist.get_markeredgecolor(), artist.get_markerfacecolor()
        artist.set_color(_shown(artist.get_color()))
        artist.set_markeredgecolor(_shown(edge))
        artist.set_markerfacecolor(_shown(face))
    elif isinstance(artist, Text):
        artist.set_color(_shown(artist.get_color()))
        if artist.get_path_effects():
            artist.set_path_effects(halo(_PAPER))
        if (box := artist.get_bbox_patch()) is not None:
            _darken(box)
    elif isinstance(artist, Patch):
        artist.set_facecolor(_shown(artist.get_facecolor()))
        artist.set_edgecolor(_shown(artist.get_edgecolor()))
    elif isinstance(artist, Collection) and artist.get_array() is None:
        artist.set_facecolor([_shown(one) for one in artist.get_facecolor()])
        artist.set_edgecolor([_shown(one) for one in artist.get_edgecolor()])
