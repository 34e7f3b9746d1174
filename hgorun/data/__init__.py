"""Measurement logs as arrays: what was measured, when it was taken, when it was known, and on which line it stands."""
