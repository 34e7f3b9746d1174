"""Figures of results: the default comparison, and those of the configuration's ``figures`` block."""

from hgorun.figures.drawing import comparison, draw
from hgorun.figures.files import save, thumbnail
from hgorun.figures.names import Names, RunNames, check
from hgorun.figures.scaling import ScaledObserver, ScalingData

__all__ = [
    "Names",
    "RunNames",
    "ScaledObserver",
    "ScalingData",
    "check",
    "comparison",
    "draw",
    "save",
    "thumbnail",
]
