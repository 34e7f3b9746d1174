"""Where steps and points of an estimate end, and when an observer is lost: one rule for files and streams."""
