"""Observers on recorded data: no plant is simulated, and no truth is known."""
