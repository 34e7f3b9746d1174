"""Whether an observer has diverged, and why."""
