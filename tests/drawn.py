"""What tests ask of figures."""

from typing import Any

from matplotlib.axes import Axes
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
