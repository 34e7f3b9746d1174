"""Gains for a stated trade-off: what is sought, the search, and the evidence."""
