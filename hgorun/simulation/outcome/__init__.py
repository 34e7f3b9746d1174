"""From the engine's arrays to the result of a run."""
