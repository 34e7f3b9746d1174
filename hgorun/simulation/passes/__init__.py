"""One pass through a run, and what may be wrong with it: values that are no numbers, features between steps."""
