"""Symbolic systems as native code, and the simulation loop."""
