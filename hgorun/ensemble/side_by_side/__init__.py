"""Passes of many members side by side, where that gives the bits that each has alone."""
