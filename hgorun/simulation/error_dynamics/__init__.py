"""How small errors of an observer grow: its slopes, the rest of its gain, from sample to sample."""
