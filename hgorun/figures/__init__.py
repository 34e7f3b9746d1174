"""Figures of results: the default comparison, and those of the configuration's ``figures`` block."""

from hgorun.figures.drawing import comparison, draw
from hgorun.figures.files import save
from hgorun.figures.names import check

__all__ = ["check", "comparison", "draw", "save"]
