"""What tests ask of figures."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.transforms import BboxBase

from hgorun.config.study import Figure


def block(*panels: dict[str, Any], **keys: Any) -> Figure:
    return Figure.model_validate({"panels": panels, **keys})


def outline(ax: Axes) -> BboxBase:
    """Of the axes with all labels."""
    box = ax.get_tightbbox()
    assert box is not None
    return box


def lines(ax: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def luminance(colour: Any) -> float:
    """Of WCAG 2.2, from 0 to 1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))
