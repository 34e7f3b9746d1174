"""Files of numbers: written through a sink, with digests, and read as if they came from a stranger."""
