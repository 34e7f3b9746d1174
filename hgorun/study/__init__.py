"""A configuration file with its runs, figures and claims; see :func:`hgorun.load_study`."""
