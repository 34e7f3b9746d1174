"""How figures look: fonts, palette, line styles, sizes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

# Okabe and Ito's colours, which colour-blind readers tell apart; black is the truth's. The yellow is
# darkened: theirs is invisible on white. Their order gives neighbours, and those that share a line
# style, different luminances.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#8A7F00")
# Solid, then long strokes: noisy lines keep their shape. None is the truth's (4, 2).
DASHES: tuple[Any, ...] = ("solid", (0, (9, 1.2)), (0, (6, 1.2, 1.2, 1.2)), (0, (1.3, 1.1)), (0, (7, 1, 1, 1, 1, 1)))
TRUTH: dict[str, Any] = {"color": "black", "linestyle": (0, (4, 2)), "linewidth": 0.9, "zorder": 5, "label": "true"}
SAMPLES: dict[str, Any] = {"color": "0.45", "zorder": 1.5, "label": "measured"}
DPI = 300
_FORGET = {"backend", "backend_fallback", "toolbar", "interactive", "timezone"}

_RC: dict[str, Any] = {
    "font.family": ["STIXGeneral", "DejaVu Serif", "DejaVu Sans"],
    "mathtext.fontset": "stix",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.5,
    "figure.titlesize": 10.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.titlelocation": "left",
    "axes.titlepad": 4.0,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-4, 5),
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.9",
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
    "pdf.fonttype": 42,
    "svg.hashsalt": "hgorun",
    "figure.constrained_layout.use": False,
    "path.simplify": True,
}


class Look(NamedTuple):
    """Colour and line style of an observer."""

    color: str
    linestyle: Any


def look(index: int) -> Look:
    """The look of the observer that comes at ``index`` in the result; the first 35 differ."""
    return Look(PALETTE[index % len(PALETTE)], DASHES[index % len(DASHES)])


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib's own defaults with our settings on top, whatever the user's; undone at the end."""
    import matplotlib

    defaults = {key: value for key, value in matplotlib.rcParamsDefault.items() if key not in _FORGET}
    with matplotlib.rc_context({**defaults, **_RC}):
        yield
