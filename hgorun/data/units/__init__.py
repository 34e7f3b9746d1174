"""Units as people write them, and numbers from one unit to another."""
