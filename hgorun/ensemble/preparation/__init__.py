"""Members of one kind, prepared together: their numbers, and their times, for many at once."""
