"""How figures look: fonts, palette, line styles, sizes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# Okabe and Ito's colours, which colour-blind readers tell apart; black is the truth's. The yellow is
# darkened: theirs is invisible on white. Three darker ones follow. Their order gives neighbours, and those
# that share a line style, different luminances.
PALETTE = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#56B4E9",
    "#CC79A7",
    "#8A7F00",
    "#5A46B4",
    "#C44601",
    "#882255",
)
# Solid, then long strokes: noisy lines keep their shape. None is the truth's (4, 2).
DASHES: tuple[Any, ...] = (
    "solid",
    (0, (9, 1.2)),
    (0, (6, 1.2, 1.2, 1.2)),
    (0, (1.3, 1.1)),
    (0, (7, 1, 1, 1, 1, 1)),
)
TRUTH: dict[str, Any] = {
    "color": "black",
    "linestyle": (0, (4, 2)),
    "linewidth": 0.9,
    "zorder": 5,
    "label": "true",
}
STATE_FEEDBACK = "state feedback"  # what a closed loop is drawn beside, as a truth
# Where one panel shows runs whose truths differ.
OTHER_TRUTHS: tuple[dict[str, Any], ...] = (
    TRUTH,
    {**TRUTH, "color": "0.35", "linestyle": (0, (1.6, 1.4))},
    {**TRUTH, "color": "0.5", "linestyle": (0, (5, 1.5, 1.2, 1.5))},
)
TRACE: dict[str, Any] = {"color": "0.62", "linewidth": 0.5, "zorder": 1.5, "label": "measured"}
DOTS: dict[str, Any] = {
    "color": "0.45",
    "zorder": 1.5,
    "label": "measured",
    "linestyle": "none",
    "marker": "o",
    "markersize": 2.2,
    "markeredgewidth": 0,
}
# Samples of recorded data, where they are few: a thick line of an estimate would hide them, and nothing else is known.
# Many would hide the estimates.
IN_FRONT: dict[str, Any] = {"zorder": 4.4, "markersize": 2.6, "markeredgecolor": "white", "markeredgewidth": 0.3}
DARK = "0.25"  # their colour
# Of recorded data: what observers did not take, and what they were not given.
OUTLIERS: dict[str, Any] = {**DOTS, "marker": "x", "markersize": 3.0, "markeredgewidth": 0.7, "label": "not used"}
HELD_OUT: dict[str, Any] = {
    **DOTS,
    "color": "black",
    "marker": "D",
    "markersize": 3.4,
    "markeredgecolor": "white",
    "markeredgewidth": 0.4,
    "zorder": 5,
    "label": "held out",
}
# Nobody was given this either, but it may be of what was measured, too: a mark that is none of its dots.
REFERENCE: dict[str, Any] = {
    **DOTS,
    "color": "black",
    "marker": "^",
    "markersize": 4.0,
    "markeredgecolor": "white",
    "markeredgewidth": 0.4,
    "zorder": 4.8,
    "label": "reference",
}
BAND, BAND_OPACITY = "95 % of ", 0.15  # of estimates: what a legend says before what should lie in them
BAND_OF_SAMPLES: dict[str, Any] = {"linestyle": (0, (1.2, 1.4)), "linewidth": 0.6}
# Where either are very many: small, and behind the estimates, as samples are.
AMONG: dict[str, Any] = {"markersize": 2.0, "markeredgewidth": 0, "zorder": 1.6}
# Greys and markers where one panel shows the measurements of several runs.
OTHER_MEASUREMENTS = (("0.62", "0.45", "o"), ("0.8", "0.7", "s"), ("0.5", "0.25", "^"))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
# Of the lines at the back and at the front of several, and the most between neighbours: a smooth one at the back stands
# in front of rougher ones in some panels, and would hide them.
WIDTHS, WIDER = (1.4, 0.8), 0.3
NEARLY_GREY = 0.08  # differences of red, green and blue up to which a colour counts as a grey
PALE = 0.4  # opacity of a line that fills an area
POINTS: dict[str, Any] = {
    "color": "0.3",
    "zorder": 4,
    "label": "measured",
    "linestyle": "none",
    "marker": "o",
    "markersize": 4.4,
    "markeredgecolor": "white",  # points on each other are seen as several
    "markeredgewidth": 0.4,
}
THEORY: dict[str, Any] = {"color": "0.3", "linestyle": "solid", "linewidth": 0.7, "zorder": 3, "label": "theory"}
# Ticks of an inset, and what shows where it is taken from.
INSET: dict[str, Any] = {"labelsize": 7.0, "pad": 1.8, "length": 2.0}
INSET_FRAME: dict[str, Any] = {"edgecolor": "0.6", "alpha": 1.0, "linewidth": 0.5, "zorder": 4.9}
DPI = 300
ENDLESS = "its farthest ends are infinite"  # the gid of a band of which that is so
GRID = "0.9"  # colour of its lines
# Sides in inches: least width; least height of a figure without panels and of each panel; largest of both.
NARROWEST, LOWEST, LARGEST = 2.0, (0.6, 0.6), 100.0
PANEL = 2.2  # inches: the height of a row of panels
LARGEST_AREA = 1_000.0  # square inches: 90 million points in a PNG
LARGEST_NUMBER = 1e100  # that axes can be divided by
# Tried for characters that the fonts above lack.
_OTHER_SCRIPTS = (
    "Noto Serif CJK JP",
    "Noto Sans CJK JP",
    "Hiragino Sans",
    "Yu Gothic",
    "Microsoft YaHei",
    "Noto Sans",
)
_FORGET = {"backend", "backend_fallback", "toolbar", "interactive", "timezone"}

_RC: dict[str, Any] = {
    "font.family": ["STIXGeneral", "DejaVu Serif", "DejaVu Sans"],
    "mathtext.fontset": "stix",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "figure.titlesize": 9.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.titlelocation": "left",
    "axes.titlepad": 4.0,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.offset_threshold": 7,  # a number to be added in a corner is overlooked: labels have so many digits
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.4,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.minor.size": 1.6,
    "ytick.minor.size": 1.6,
    "lines.linewidth": 1.0,
    "lines.solid_joinstyle": "round",
    "lines.dash_joinstyle": "round",
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "legend.columnspacing": 1.4,
    "legend.handletextpad": 0.5,
    "legend.borderpad": 0.1,
    "legend.title_fontsize": 9.0,
    "pdf.fonttype": 42,
    "svg.hashsalt": "hgorun",
    "figure.constrained_layout.use": False,
}


def edged(colour: str, alpha: float) -> dict[str, Any]:
    """How a band is drawn: with edges, so that each is told where several overlap."""
    from matplotlib.colors import to_rgba

    return {"facecolor": to_rgba(colour, alpha), "edgecolor": to_rgba(colour, 0.7), "linewidth": 0.4}


def luminance(red: float, green: float, blue: float) -> float:
    """How light a colour is, from 0 to 1, of parts from 0 to 1."""
    return float(0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2)


def inked(dashes: Any) -> float:
    """The part of a line that is drawn: 1 without gaps."""
    lengths = [1.0] if dashes == "solid" else dashes[1]
    return sum(lengths[::2]) / sum(lengths)


def _require_matplotlib() -> None:
    """Import it; a backend that the environment names and that is not installed is no hindrance, for none is used."""
    try:
        import matplotlib  # tried here
    except ValueError:
        named = os.environ.pop("MPLBACKEND")
        try:
            import matplotlib  # noqa: F401  # tried again
        finally:
            os.environ["MPLBACKEND"] = named


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib's own defaults with our settings on top, whatever the user's; undone at the end."""
    _require_matplotlib()
    import matplotlib
    from matplotlib import font_manager

    settings: dict[Any, Any] = {
        key: value for key, value in dict.items(matplotlib.rcParamsDefault) if key not in _FORGET
    }
    settings.update(_RC)
    installed = set(font_manager.get_font_names())
    settings["font.family"] = [*_RC["font.family"], *(name for name in _OTHER_SCRIPTS if name in installed)]
    with matplotlib.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # the figure shows which
        yield
