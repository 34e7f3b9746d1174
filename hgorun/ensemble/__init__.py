"""Many members of one experiment: what they differ in, and their metrics and statuses as arrays."""
