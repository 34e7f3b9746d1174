"""The observers, one file a family."""
