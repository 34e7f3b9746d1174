"""Observers for other places: as C code without libraries, as equations of a paper, as units of other simulators."""
