"""Plant and observers as one hybrid system, compiled once for all runs that differ in numbers alone."""
