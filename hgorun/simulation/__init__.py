"""From a validated configuration to trajectories."""
