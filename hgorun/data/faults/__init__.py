"""What betrays that samples are not what was measured when it was measured, and what is done about it."""
