"""Quantities that are asked of results: read from text, measured on trajectories."""
