"""A validated configuration with its plant, its observers and its schedule."""
