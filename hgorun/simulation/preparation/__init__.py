"""From an experiment to a run that is ready to be integrated."""
