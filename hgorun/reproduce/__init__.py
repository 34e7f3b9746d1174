"""Figures and claims of many files: in parallel, only what has changed, nothing lost when interrupted."""
